// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/features/feature_detector.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "observe/features/feature_match.hpp"
#include "observe/features/orb_features.hpp"
#include "observe/terms/exposure.hpp"
#include "observe/terms/rig_pose.hpp"
#include "sightline/base/log.hpp"

namespace sightline {

using namespace observe;

namespace {

struct GrayFrame {
  CameraId id;
  std::shared_ptr<const CalibratedCamera> calibration;
  std::vector<uint8_t> gray;
  FrameInfo info;
  bool fresh = false;
  ExposureGain exposure = {};
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
       const FeatureDetectorOptions& options, Executor executor)
      : model_(std::move(model)),
        descriptors_(model_->features),
        options_(options),
        executor_(std::move(executor)) {
    for (DetectorCamera& camera : cameras) {
      frames_.push_back({camera.id,
                         std::make_shared<const CalibratedCamera>(std::move(camera.calibration)),
                         {},
                         {},
                         false});
    }
    for (const TrainedFeature& feature : model_->features) {
      middle_ += feature.point.cast<double>() / static_cast<double>(model_->features.size());
    }
    for (const TrainedFeature& feature : model_->features) {
      radius_ = std::max(radius_, (feature.point.cast<double>() - middle_).norm());
    }
  }

  void add_frame(CameraId camera, const Frame& frame) {
    const FrameInfo& info = frame.info();
    for (GrayFrame& seen : frames_) {
      const CameraModel& model = seen.calibration->model;
      if (seen.id != camera || info.status == FrameStatus::kDamaged ||
          info.width != model.width() || info.height != model.height()) {
        continue;
      }
      const PlaneView gray = frame.gray();
      seen.gray.resize(static_cast<size_t>(gray.width) * static_cast<size_t>(gray.height));
      expose_luma(seen.exposure.update(gray), gray,
                  {seen.gray.data(), gray.width, gray.height, gray.width});
      seen.info = info;
      seen.fresh = true;
      if (!info.place) continue;
      CalibratedCamera turned = *seen.calibration;  // terms keep the one before
      turned.world_from_camera = info.place->world_from_camera;
      seen.calibration = std::make_shared<const CalibratedCamera>(std::move(turned));
    }
  }

  // `earlier`: near its poses; null: everywhere.
  PoseProposals propose(const Detection* earlier) {
    PoseProposals out;
    std::vector<RigView> views;
    std::vector<size_t> cameras;  // by view
    for (const GrayFrame& seen : frames_) {
      if (seen.fresh) out.time = std::max(out.time, seen.info.capture);
    }
    for (size_t i = 0; i < frames_.size(); ++i) {
      GrayFrame& seen = frames_[i];
      if (!seen.fresh || out.time - seen.info.capture > options_.max_age) continue;
      seen.fresh = false;
      views.push_back({seen.calibration, to_seconds(seen.info.capture - out.time)});
      cameras.push_back(i);
    }
    const std::vector<RigMatch> matches = match(earlier, cameras);
    if (matches.size() < static_cast<size_t>(options_.pose.min_inliers)) return out;
    const auto poses = solve_rig(views, matches, rig_options());
    log::debug("features: {} matches, {} agree on the best pose", matches.size(),
               poses.empty() ? 0 : poses.front().inliers.size());
    if (poses.empty() || !certain(views, matches, poses.front())) return out;
    for (const RigPose& pose : poses) {
      ProposedPose proposed{pose.motion.world_from_object,
                            pose.motion.twist,
                            evidence(pose, poses.front()),
                            pose.inliers.size(),
                            false,
                            std::vector<PoseTermPtr>(frames_.size())};
      if (!(proposed.evidence > 0)) continue;
      for (size_t k = 0; k < views.size(); ++k) proposed.terms[cameras[k]] = pose.terms[k];
      out.poses.push_back(std::move(proposed));
    }
    return out;
  }

 private:
  RigPoseOptions rig_options() const {
    RigPoseOptions out;
    out.inlier_px = options_.pose.inlier_px;
    out.huber = options_.pose.huber;
    out.view_error = options_.pose.view_error;
    return out;
  }

  struct Box {
    int x0, y0, x1, y1;
    int max;  // features
  };
  std::optional<Box> whole(const GrayFrame& seen) const {
    const CameraModel& camera = seen.calibration->model;
    return Box{0, 0, camera.width(), camera.height(), options_.match.per_image};
  }

  // Where a camera sees the object at the newest frame's time, if it has gone on as it did.
  std::optional<Box> place_of(const Detection& earlier, const GrayFrame& seen) const {
    const CameraModel& camera = seen.calibration->model;
    const Rigid3 camera_from_world = seen.calibration->world_from_camera.inverse();
    const double seconds = to_seconds(seen.info.capture - earlier.time);
    Eigen::AlignedBox2d box;
    for (const DetectedPose& pose : earlier.poses) {
      const Rigid3 moved = pose.world_from_object * Rigid3::exp(pose.twist * seconds);
      const Eigen::Vector3d middle = camera_from_world * (moved * middle_);
      const auto pixel = camera.project(middle);
      if (!pixel) continue;
      const double reach =
          camera.parameters().fx * (radius_ + options_.max_displacement) / middle.norm();
      box.extend(*pixel - Eigen::Vector2d::Constant(reach));
      box.extend(*pixel + Eigen::Vector2d::Constant(reach));
    }
    const Eigen::AlignedBox2d image(Eigen::Vector2d::Zero(),
                                    Eigen::Vector2d(camera.width(), camera.height()));
    const Eigen::AlignedBox2d seen_part = box.intersection(image);
    if (box.isEmpty() || seen_part.isEmpty()) return std::nullopt;
    const Eigen::Vector2i low = seen_part.min().cast<int>(), high = seen_part.max().cast<int>();
    return Box{low.x(), low.y(), high.x(), high.y(),
               std::max(options_.match.min_per_place, options_.match.per_image / 4)};
  }

  std::vector<RigMatch> match(const Detection* earlier, const std::vector<size_t>& cameras) const {
    std::vector<std::vector<RigMatch>> by_view(cameras.size());
    executor_(cameras.size(), [&](size_t view) {
      const GrayFrame& seen = frames_[cameras[view]];
      const auto place = earlier == nullptr ? whole(seen) : place_of(*earlier, seen);
      if (place) match(seen, view, *place, by_view[view]);
    });
    std::vector<RigMatch> out;
    for (const auto& matches : by_view) out.insert(out.end(), matches.begin(), matches.end());
    return out;
  }

  // One match for every place of the image and of the object, the one that differs least.
  void match(const GrayFrame& seen, size_t view, const Box& place,
             std::vector<RigMatch>& out) const {
    const CameraModel& camera = seen.calibration->model;
    const PlaneView gray{seen.gray.data(), camera.width(), camera.height(), camera.width()};
    const auto features =
        orb_features(gray, place.x0, place.y0, place.x1, place.y1, place.max, nullptr);
    std::vector<NearestTrained> nearest(features.size());
    match_features(features, descriptors_, static_cast<float>(options_.match.other_place), nearest);
    std::vector<size_t> order;
    for (size_t i = 0; i < features.size(); ++i) {
      const NearestTrained& n = nearest[i];
      if (n.index != NearestTrained::kNone && n.bits <= options_.match.max_bits &&
          n.bits <= options_.match.ratio * n.other)
        order.push_back(i);
    }
    std::stable_sort(order.begin(), order.end(),
                     [&](size_t a, size_t b) { return nearest[a].bits < nearest[b].bits; });
    for (const size_t i : order) {
      add_match(camera, view, features[i], model_->features[nearest[i].index], out);
    }
    share_noise(out);
  }

  void add_match(const CameraModel& camera, size_t view, const OrbFeature& feature,
                 const TrainedFeature& trained, std::vector<RigMatch>& out) const {
    const auto patch = image_patch(camera, feature.pixel, feature.angle, kOrbPatch * feature.scale);
    if (!patch) return;
    const RigMatch made{view,
                        {trained.point.cast<double>(), feature.pixel,
                         options_.match.sigma_px * std::max(1.0, feature.scale)},
                        {trained.view.cast<double>(), trained.normal.cast<double>(),
                         trained.direction.cast<double>(), static_cast<double>(trained.size)},
                        *patch};
    const bool known = std::any_of(out.begin(), out.end(), [&](const RigMatch& other) {
      return (other.match.pixel - made.match.pixel).norm() < options_.match.same_px &&
             (other.match.point_in_object - made.match.point_in_object).norm() <
                 options_.match.same_place;
    });
    if (!known) out.push_back(made);
  }

  // Errors of what lies close together are correlated: each counts for its share.
  void share_noise(std::span<RigMatch> matches) const {
    std::vector<double> sharing;
    for (const RigMatch& match : matches) {
      sharing.push_back(static_cast<double>(
          std::count_if(matches.begin(), matches.end(), [&](const RigMatch& other) {
            return (other.match.pixel - match.match.pixel).norm() < options_.match.correlation_px;
          })));
    }
    for (size_t i = 0; i < matches.size(); ++i) matches[i].match.sigma_px *= std::sqrt(sharing[i]);
  }

  double evidence(const RigPose& pose, const RigPose& best) const {
    if (2 * twist_cost(pose.motion.twist) > options_.pose.max_twist * options_.pose.max_twist) {
      return 0;
    }
    const double likely =
        1 - std::exp((options_.evidence.chance - pose.support) / options_.evidence.usual);
    const double share = pose.support / best.support;
    return options_.evidence.max * likely * share * share;
  }

  // A flat thing that one camera alone sees from the front: its tilt shows in second order only, in
  // less than what features seen from another side than trained have in common.
  bool facing_one_camera(const std::vector<RigView>& views, const RigPose& pose) const {
    size_t seeing = 0, view = 0;
    for (size_t i = 0; i < views.size(); ++i) {
      const auto* term = dynamic_cast<const ReprojectionTerm*>(pose.terms[i].get());
      if (term == nullptr ||
          term->matches().size() < static_cast<size_t>(options_.pose.min_of_view))
        continue;
      ++seeing;
      view = i;
    }
    const auto tilt = seeing == 1 ? flat_tilt(views, pose, view) : std::nullopt;
    return tilt && *tilt * 180 / std::numbers::pi < options_.pose.min_tilt_deg;
  }

  // Enough matches, not all in one corner of the object, and a pose that they determine.
  bool certain(const std::vector<RigView>& views, const std::vector<RigMatch>& matches,
               const RigPose& pose) const {
    if (pose.inliers.size() < static_cast<size_t>(options_.pose.min_inliers)) return false;
    if (spread(matches, pose) < options_.pose.min_spread) return false;
    if (facing_one_camera(views, pose)) return false;
    const auto system = linearize_rig(pose.terms, views, pose.motion);
    const Matrix6 covariance = system.information.inverse().topLeftCorner<6, 6>();
    const auto worst = [](const Eigen::Matrix3d& block) {
      return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(block, Eigen::EigenvaluesOnly)
                           .eigenvalues()[2]);
    };
    return covariance.allFinite() &&
           worst(covariance.topLeftCorner<3, 3>()) * 180 / std::numbers::pi <=
               options_.pose.max_sigma_deg &&
           worst(covariance.bottomRightCorner<3, 3>()) <= options_.pose.max_sigma_m;
  }

  std::shared_ptr<const FeatureModel> model_;
  const TrainedDescriptors descriptors_;
  const FeatureDetectorOptions options_;
  const Executor executor_;
  std::vector<GrayFrame> frames_;
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();  // of the trained places, object frame
  double radius_ = 0;                                 // about it
};

Result<std::unique_ptr<FeatureDetector>> FeatureDetector::create(
    std::shared_ptr<const FeatureModel> model, std::vector<DetectorCamera> cameras,
    const FeatureDetectorOptions& o, Executor executor) {
  const std::string where = "feature detector";
  const FeatureMatchOptions& match = o.match;
  const FeaturePoseOptions& pose = o.pose;
  const FeatureEvidenceOptions& evidence = o.evidence;
  if (cameras.empty()) return make_error(ErrorCode::kInvalidInput, where, "has no camera");
  if (model == nullptr || model->features.empty()) {
    return make_error(ErrorCode::kInvalidInput, where, "has no trained features");
  }
  if (match.per_image < 50 || match.per_image > 10'000 || !(match.sigma_px > 0) ||
      !(match.ratio > 0) || pose.min_inliers < 6 || !(pose.inlier_px > 0) ||
      !(evidence.usual > 0) || !(evidence.chance >= 0) || !(evidence.max > 0) ||
      o.max_age < Duration(0) || !(o.max_displacement >= 0)) {
    return make_error(ErrorCode::kInvalidInput, where, "an option is out of range");
  }
  return std::unique_ptr<FeatureDetector>(new FeatureDetector(
      std::make_unique<Impl>(std::move(model), std::move(cameras), o, std::move(executor))));
}

FeatureDetector::FeatureDetector(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
FeatureDetector::~FeatureDetector() = default;

void FeatureDetector::add_frame(CameraId camera, const Frame& frame) {
  impl_->add_frame(camera, frame);
}
PoseProposals FeatureDetector::propose() { return impl_->propose(nullptr); }
PoseProposals FeatureDetector::propose_near(const Detection& earlier) {
  return earlier.poses.empty() ? PoseProposals() : impl_->propose(&earlier);
}

}  // namespace sightline
