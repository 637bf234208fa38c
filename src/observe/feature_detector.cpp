// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/feature_detector.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "feature_match.hpp"
#include "orb_features.hpp"
#include "rig_pose.hpp"

namespace sightline {
namespace {

using observe::NearestTaught;
using observe::OrbFeature;
using observe::RigMatch;
using observe::RigPose;
using observe::RigView;

constexpr Duration kTogether = std::chrono::milliseconds(100);
constexpr double kSamePixel = 2.0;    // neighbours at several scales ...
constexpr double kSamePlace = 0.004;  // ... of one place [m] are one match

constexpr double kStray = 0.08;     // [m] that it may have moved otherwise
constexpr int kLeastOfPlace = 500;  // features
constexpr size_t kLeastOfView = 8;  // matches with which it has a say

struct Seen {
  CameraId id;
  std::shared_ptr<const CalibratedCamera> calibration;
  std::vector<uint8_t> grey;
  FrameInfo info;
  bool fresh = false;
};

// Root mean square distance of the supporting points from their middle [m].
double spread(const std::vector<RigMatch>& matches, const RigPose& pose) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  const double count = static_cast<double>(pose.inliers.size());
  for (const size_t i : pose.inliers) middle += matches[i].match.point_in_object / count;
  double sum = 0;
  for (const size_t i : pose.inliers) {
    sum += (matches[i].match.point_in_object - middle).squaredNorm();
  }
  return std::sqrt(sum / count);
}

}  // namespace

class FeatureDetector::Impl {
 public:
  Impl(std::shared_ptr<const FeatureModel> model, std::vector<DetectorCamera> cameras,
       const FeatureDetectorOptions& options)
      : model_(std::move(model)), options_(options) {
    for (DetectorCamera& camera : cameras) {
      seen_.push_back({camera.id,
                       std::make_shared<const CalibratedCamera>(std::move(camera.calibration)),
                       {},
                       {},
                       false});
    }
    for (const TaughtFeature& feature : model_->features) {
      middle_ += feature.point.cast<double>() / static_cast<double>(model_->features.size());
    }
    for (const TaughtFeature& feature : model_->features) {
      radius_ = std::max(radius_, (feature.point.cast<double>() - middle_).norm());
    }
  }

  void add_frame(CameraId camera, const Frame& frame) {
    const FrameInfo& info = frame.info();
    for (Seen& seen : seen_) {
      const CameraModel& model = seen.calibration->model;
      if (seen.id != camera || info.status == FrameStatus::kDamaged ||
          info.width != model.width() || info.height != model.height()) {
        continue;
      }
      const PlaneView grey = frame.grey();
      seen.grey.resize(static_cast<size_t>(grey.width) * static_cast<size_t>(grey.height));
      for (int y = 0; y < grey.height; ++y) {
        std::copy_n(grey.row(y), grey.width,
                    seen.grey.begin() + static_cast<ptrdiff_t>(y) * grey.width);
      }
      seen.info = info;
      seen.fresh = true;
    }
  }

  // `earlier`: look around its poses; null: everywhere.
  Proposals propose(const Detection* earlier) {
    Proposals out;
    std::vector<RigView> views;
    std::vector<size_t> cameras;  // by view
    std::vector<RigMatch> matches;
    for (const Seen& seen : seen_) {
      if (seen.fresh) out.time = std::max(out.time, seen.info.capture);
    }
    for (size_t i = 0; i < seen_.size(); ++i) {
      Seen& seen = seen_[i];
      if (!seen.fresh || out.time - seen.info.capture > kTogether) continue;
      seen.fresh = false;
      const auto place = earlier == nullptr ? whole(seen) : place_of(*earlier, seen);
      if (place) match(seen, views.size(), *place, matches);
      views.push_back({seen.calibration, to_seconds(seen.info.capture - out.time)});
      cameras.push_back(i);
    }
    if (matches.size() < static_cast<size_t>(options_.min_inliers)) return out;
    const auto poses = observe::solve_rig(views, matches, rig_options());
    if (poses.empty() || !certain(views, matches, poses.front())) return out;
    for (const RigPose& pose : poses) {
      ProposedPose proposed{pose.motion.world_from_object, pose.motion.twist,
                            evidence(pose, poses.front()), std::vector<PoseTermPtr>(seen_.size())};
      if (!(proposed.evidence > 0)) continue;
      for (size_t k = 0; k < views.size(); ++k) proposed.terms[cameras[k]] = pose.terms[k];
      out.poses.push_back(std::move(proposed));
    }
    return out;
  }

 private:
  observe::RigPoseOptions rig_options() const {
    observe::RigPoseOptions out;
    out.inlier_px = options_.inlier_px;
    out.huber = options_.huber;
    out.view_error = options_.view_error;
    return out;
  }

  struct Box {
    int x0, y0, x1, y1;
    int most;  // features
  };
  std::optional<Box> whole(const Seen& seen) const {
    const CameraModel& camera = seen.calibration->model;
    return Box{0, 0, camera.width(), camera.height(), options_.per_picture};
  }

  // Where a camera sees the object at the newest frame's time, if it has gone on as it did.
  std::optional<Box> place_of(const Detection& earlier, const Seen& seen) const {
    const CameraModel& camera = seen.calibration->model;
    const Rigid3 camera_from_world = seen.calibration->world_from_camera.inverse();
    const double seconds = to_seconds(seen.info.capture - earlier.time);
    Eigen::AlignedBox2d box;
    for (const DetectedPose& pose : earlier.poses) {
      const Rigid3 moved = pose.world_from_object * Rigid3::exp(pose.twist * seconds);
      const Eigen::Vector3d middle = camera_from_world * (moved * middle_);
      const auto pixel = camera.project(middle);
      if (!pixel) continue;
      const double reach = camera.parameters().fx * (radius_ + kStray) / middle.norm();
      box.extend(*pixel - Eigen::Vector2d::Constant(reach));
      box.extend(*pixel + Eigen::Vector2d::Constant(reach));
    }
    const Eigen::AlignedBox2d picture(Eigen::Vector2d::Zero(),
                                      Eigen::Vector2d(camera.width(), camera.height()));
    const Eigen::AlignedBox2d seen_part = box.intersection(picture);
    if (box.isEmpty() || seen_part.isEmpty()) return std::nullopt;
    const Eigen::Vector2i low = seen_part.min().cast<int>(), high = seen_part.max().cast<int>();
    return Box{low.x(), low.y(), high.x(), high.y(),
               std::max(kLeastOfPlace, options_.per_picture / 4)};
  }

  // One match for every place of the picture and of the object, the one that differs least.
  void match(const Seen& seen, size_t view, const Box& place, std::vector<RigMatch>& out) const {
    const CameraModel& camera = seen.calibration->model;
    const PlaneView grey{seen.grey.data(), camera.width(), camera.height(), camera.width()};
    const auto features =
        observe::orb_features(grey, place.x0, place.y0, place.x1, place.y1, place.most, nullptr);
    std::vector<NearestTaught> nearest(features.size());
    observe::match_features(features, model_->features, static_cast<float>(options_.elsewhere),
                            nearest);
    std::vector<size_t> order;
    for (size_t i = 0; i < features.size(); ++i) {
      const NearestTaught& n = nearest[i];
      if (n.bits <= options_.most_bits && n.bits <= options_.ratio * n.other) order.push_back(i);
    }
    std::stable_sort(order.begin(), order.end(),
                     [&](size_t a, size_t b) { return nearest[a].bits < nearest[b].bits; });
    const size_t first = out.size();
    for (const size_t i : order) {
      const TaughtFeature& taught = model_->features[nearest[i].index];
      const RigMatch made{view,
                          {taught.point.cast<double>(), features[i].pixel,
                           options_.sigma_px * std::max(1.0, features[i].scale)},
                          taught.view.cast<double>()};
      const bool known = std::any_of(
          out.begin() + static_cast<ptrdiff_t>(first), out.end(), [&](const RigMatch& other) {
            return (other.match.pixel - made.match.pixel).norm() < kSamePixel &&
                   (other.match.point_in_object - made.match.point_in_object).norm() < kSamePlace;
          });
      if (!known) out.push_back(made);
    }
    share_noise({out.begin() + static_cast<ptrdiff_t>(first), out.end()});
  }

  // What lies close together errs together: each counts for its share.
  void share_noise(std::span<RigMatch> matches) const {
    std::vector<double> sharing;
    for (const RigMatch& match : matches) {
      sharing.push_back(static_cast<double>(
          std::count_if(matches.begin(), matches.end(), [&](const RigMatch& other) {
            return (other.match.pixel - match.match.pixel).norm() < options_.correlation_px;
          })));
    }
    for (size_t i = 0; i < matches.size(); ++i) matches[i].match.sigma_px *= std::sqrt(sharing[i]);
  }

  double evidence(const RigPose& pose, const RigPose& best) const {
    if (2 * observe::twist_cost(pose.motion.twist) > options_.most_twist * options_.most_twist) {
      return 0;
    }
    const double likely = 1 - std::exp((options_.chance - pose.support) / options_.usual);
    return options_.most * likely * std::sqrt(pose.support / best.support);
  }

  // A flat thing that one camera alone sees from the front: its tilt shows in second order only, in
  // less than what features seen from another side than taught have in common.
  bool facing_one_camera(const std::vector<RigView>& views, const RigPose& pose) const {
    size_t seeing = 0, view = 0;
    for (size_t i = 0; i < views.size(); ++i) {
      const auto* term = dynamic_cast<const CornerTerm*>(pose.terms[i].get());
      if (term == nullptr || term->matches().size() < kLeastOfView) continue;
      ++seeing;
      view = i;
    }
    const auto tilt = seeing == 1 ? observe::flat_tilt(views, pose, view) : std::nullopt;
    return tilt && *tilt * 180 / std::numbers::pi < options_.least_tilt_deg;
  }

  // Enough matches, not all in one corner of the object, and a pose that they determine.
  bool certain(const std::vector<RigView>& views, const std::vector<RigMatch>& matches,
               const RigPose& pose) const {
    if (pose.inliers.size() < static_cast<size_t>(options_.min_inliers)) return false;
    if (spread(matches, pose) < options_.min_spread) return false;
    if (facing_one_camera(views, pose)) return false;
    const auto system = observe::linearize_rig(pose.terms, views, pose.motion);
    const Matrix6 covariance = system.information.inverse().topLeftCorner<6, 6>();
    const auto worst = [](const Eigen::Matrix3d& block) {
      return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(block, Eigen::EigenvaluesOnly)
                           .eigenvalues()[2]);
    };
    return covariance.allFinite() &&
           worst(covariance.topLeftCorner<3, 3>()) * 180 / std::numbers::pi <=
               options_.most_sigma_deg &&
           worst(covariance.bottomRightCorner<3, 3>()) <= options_.most_sigma_m;
  }

  std::shared_ptr<const FeatureModel> model_;
  FeatureDetectorOptions options_;
  std::vector<Seen> seen_;
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();  // of the taught places, object frame
  double radius_ = 0;                                 // about it
};

Result<std::unique_ptr<FeatureDetector>> FeatureDetector::create(
    std::shared_ptr<const FeatureModel> model, std::vector<DetectorCamera> cameras,
    const FeatureDetectorOptions& o) {
  const std::string where = "feature detector";
  if (cameras.empty()) return make_error(ErrorCode::kInvalidInput, where, "has no camera");
  if (model == nullptr || model->features.empty()) {
    return make_error(ErrorCode::kInvalidInput, where, "was taught no features");
  }
  if (o.per_picture < 50 || o.per_picture > 10'000 || o.min_inliers < 6 || !(o.inlier_px > 0) ||
      !(o.sigma_px > 0) || !(o.ratio > 0) || !(o.usual > 0) || !(o.chance >= 0) || !(o.most > 0)) {
    return make_error(ErrorCode::kInvalidInput, where, "an option is out of range");
  }
  return std::unique_ptr<FeatureDetector>(
      new FeatureDetector(std::make_unique<Impl>(std::move(model), std::move(cameras), o)));
}

FeatureDetector::FeatureDetector(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
FeatureDetector::~FeatureDetector() = default;

void FeatureDetector::add_frame(CameraId camera, const Frame& frame) {
  impl_->add_frame(camera, frame);
}
Proposals FeatureDetector::propose() { return impl_->propose(nullptr); }
Proposals FeatureDetector::propose_near(const Detection& earlier) {
  return earlier.poses.empty() ? Proposals() : impl_->propose(&earlier);
}

}  // namespace sightline
