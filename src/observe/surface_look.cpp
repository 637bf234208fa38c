// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/surface_look.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "detection_term.hpp"
#include "edge_maps.hpp"

namespace sightline {
namespace {

constexpr size_t kLeastSpots = 50;
constexpr size_t kLeastSeen = 40;       // spots of one camera that can be compared
constexpr float kLeastFacing = 0.3f;    // cosine between normal and line of sight
constexpr double kLeastLikeness = 0.3;  // below it the colours say nothing
constexpr double kClearly = 0.1;        // less alike than the best one

struct Seen {
  FrameInfo info;
  SmallPicture picture;
  bool valid = false;
};

// Mean of 3 x 3 pixels; empty at the border and outside.
std::optional<Eigen::Vector3f> colour_at(const SmallPicture& picture, const Eigen::Vector2d& at) {
  const int x = static_cast<int>(std::floor(at.x() + 0.5));
  const int y = static_cast<int>(std::floor(at.y() + 0.5));
  if (x < 1 || y < 1 || x >= picture.width - 1 || y >= picture.height - 1) return std::nullopt;
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (int v = y - 1; v <= y + 1; ++v) {
    for (int u = x - 1; u <= x + 1; ++u) {
      for (int plane = 0; plane < 3; ++plane) {
        sum[plane] += static_cast<float>(picture.row(static_cast<size_t>(plane), v)[u]);
      }
    }
  }
  return sum / 9;
}

// Correlation of all channels together, each about its own mean.
double correlation(const std::vector<Eigen::Vector3f>& a, const std::vector<Eigen::Vector3f>& b) {
  Eigen::Vector3d mean_a = Eigen::Vector3d::Zero(), mean_b = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < a.size(); ++i) {
    mean_a += a[i].cast<double>() / static_cast<double>(a.size());
    mean_b += b[i].cast<double>() / static_cast<double>(a.size());
  }
  double both = 0, only_a = 0, only_b = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    const Eigen::Vector3d u = a[i].cast<double>() - mean_a, v = b[i].cast<double>() - mean_b;
    both += u.dot(v);
    only_a += u.squaredNorm();
    only_b += v.squaredNorm();
  }
  const double scale = std::sqrt(only_a * only_b);
  return scale > 1e-6 ? both / scale : 0;
}

}  // namespace

class SurfaceLook::Impl {
 public:
  Impl(std::vector<SurfaceSpot> spots, std::vector<DetectorCamera> cameras)
      : spots_(std::move(spots)), cameras_(std::move(cameras)), seen_(cameras_.size()) {}

  void add_frame(CameraId camera, const Frame& frame) {
    for (size_t i = 0; i < cameras_.size(); ++i) {
      if (cameras_[i].id == camera) remember(frame, i);
    }
  }

  double likeness(const Observation& observation, const Rigid3& world_from_object) const {
    for (size_t i = 0; i < cameras_.size(); ++i) {
      if (cameras_[i].id != observation.camera || !seen_[i].valid ||
          seen_[i].info.capture != observation.capture)
        continue;
      return likeness(i, world_from_object);
    }
    return 0;
  }

  void resolve(Detection& detection) const {
    if (detection.poses.size() < 2) return;
    std::vector<double> alike(detection.poses.size(), 0);
    for (const Observation& observation : detection.observations) {
      for (size_t k = 0; k < alike.size() && k < observation.hypotheses.size(); ++k) {
        alike[k] += likeness(observation, observation.hypotheses[k].world_from_object) /
                    static_cast<double>(detection.observations.size());
      }
    }
    const double best = *std::max_element(alike.begin(), alike.end());
    if (best < kLeastLikeness) return;
    for (size_t k = alike.size(); k-- > 0;) {
      if (alike[k] < best - kClearly) drop(k, detection);
    }
  }

 private:
  void remember(const Frame& frame, size_t index) {
    const CameraModel& model = cameras_[index].calibration.model;
    if (frame.info().status == FrameStatus::kDamaged || frame.info().width != model.width() ||
        frame.info().height != model.height())
      return;
    Seen& seen = seen_[index];
    seen.info = frame.info();
    const PlaneView luma = frame.half_grey();
    const I420View full = frame.i420();
    seen.picture.width = luma.width;
    seen.picture.height = luma.height;
    const std::array<PlaneView, 3> planes = {luma, full.u, full.v};
    for (size_t k = 0; k < 3; ++k) {
      const auto width = static_cast<size_t>(luma.width);
      seen.picture.planes[k].resize(width * static_cast<size_t>(luma.height));
      for (int y = 0; y < luma.height; ++y) {
        std::copy_n(planes[k].row(y), luma.width,
                    seen.picture.planes[k].data() + static_cast<size_t>(y) * width);
      }
    }
    seen.valid = true;
  }

  double likeness(size_t camera, const Rigid3& world_from_object) const {
    const CalibratedCamera& calibration = cameras_[camera].calibration;
    const Rigid3 camera_from_object = calibration.world_from_camera.inverse() * world_from_object;
    const Eigen::Vector3f eye = camera_from_object.inverse().translation.cast<float>();
    std::vector<Eigen::Vector3f> painted, shown;
    for (size_t i = 0; i < spots_.size(); ++i) {
      const Eigen::Vector3f sight = eye - spots_[i].point;
      if (sight.dot(spots_[i].normal) < kLeastFacing * sight.norm()) continue;
      const auto pixel =
          calibration.model.project(camera_from_object * spots_[i].point.cast<double>());
      if (!pixel) continue;
      const Eigen::Vector2d half = (*pixel + Eigen::Vector2d::Constant(0.5)) / 2;
      const auto colour = colour_at(seen_[camera].picture, half - Eigen::Vector2d::Constant(0.5));
      if (!colour) continue;
      painted.push_back(spots_[i].color);
      shown.push_back(*colour);
    }
    return painted.size() >= kLeastSeen ? correlation(painted, shown) : 0;
  }

  // Pose k goes, and with it its share of every observation.
  static void drop(size_t k, Detection& detection) {
    const auto at = static_cast<ptrdiff_t>(k);
    detection.poses.erase(detection.poses.begin() + at);
    for (Observation& observation : detection.observations) {
      observation.hypotheses.erase(observation.hypotheses.begin() + at);
      for (PoseTermPtr& term : observation.terms) {
        const auto* several = dynamic_cast<const DetectionTerm*>(term.get());
        if (several != nullptr) term = several->without(k);
      }
    }
  }

  const std::vector<SurfaceSpot> spots_;
  const std::vector<DetectorCamera> cameras_;
  std::vector<Seen> seen_;
};

Result<std::unique_ptr<SurfaceLook>> SurfaceLook::create(std::vector<SurfaceSpot> spots,
                                                         std::vector<DetectorCamera> cameras) {
  if (spots.size() < kLeastSpots) {
    return make_error(ErrorCode::kInvalidInput, "surface look", "{} spots, {} are needed",
                      spots.size(), kLeastSpots);
  }
  return std::unique_ptr<SurfaceLook>(
      new SurfaceLook(std::make_unique<Impl>(std::move(spots), std::move(cameras))));
}

SurfaceLook::SurfaceLook(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SurfaceLook::~SurfaceLook() = default;

void SurfaceLook::add_frame(CameraId camera, const Frame& frame) {
  impl_->add_frame(camera, frame);
}
double SurfaceLook::likeness(const Observation& observation,
                             const Rigid3& world_from_object) const {
  return impl_->likeness(observation, world_from_object);
}
void SurfaceLook::resolve(Detection& detection) const { impl_->resolve(detection); }

}  // namespace sightline
