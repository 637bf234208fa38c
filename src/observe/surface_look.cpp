// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/surface_look.hpp"

#include <algorithm>
#include <array>

#include "detection_term.hpp"
#include "edge_maps.hpp"
#include "surface_likeness.hpp"

namespace sightline {

using observe::surface_likeness;

namespace {

constexpr size_t kLeastSpots = 50;
constexpr double kClearly = 0.1;  // less alike than the best one

struct Seen {
  FrameInfo info;
  SmallPicture picture;
  bool valid = false;
};

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

  void compare(const Lookalikes& lookalikes, Detection& detection) const {
    for (Observation& observation : detection.observations) {
      if (observation.hypotheses.empty() || lookalikes.turns.empty()) continue;
      const Rigid3 pose = observation.hypotheses.front().world_from_object;
      std::vector<PoseHypothesis> alike;
      double best = likeness(observation, pose);
      alike.push_back({pose, observe::likeness_cost(best)});
      for (const Rigid3& turn : lookalikes.turns) {
        const double other = likeness(observation, pose * turn);
        alike.push_back({pose * turn, observe::likeness_cost(other)});
        best = std::max(best, other);
      }
      if (best >= observe::kLeastLikeness) observation.alike = std::move(alike);
    }
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
    if (best < observe::kLeastLikeness) return;
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
    const SmallPicture& picture = seen_[camera].picture;
    std::array<PlaneView, 3> planes;
    for (size_t k = 0; k < 3; ++k) {
      planes[k] = {picture.planes[k].data(), picture.width, picture.height, picture.width};
    }
    return surface_likeness(spots_, calibration.model,
                            calibration.world_from_camera.inverse() * world_from_object, planes);
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
void SurfaceLook::compare(const Lookalikes& lookalikes, Detection& detection) const {
  impl_->compare(lookalikes, detection);
}

}  // namespace sightline
