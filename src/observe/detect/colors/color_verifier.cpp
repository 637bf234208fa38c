// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/detect/color_verifier.hpp"

#include <algorithm>
#include <array>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/pixels/half_size_frame.hpp"
#include "observe/shape/color_correlation.hpp"
#include "observe/terms/detection_term.hpp"

namespace sightline {

using namespace observe;

class ColorVerifier::Impl {
 public:
  Impl(std::vector<SurfaceSample> samples, std::vector<DetectorCamera> cameras)
      : samples_(std::move(samples)), cameras_(std::move(cameras)), frames_(cameras_.size()) {}

  std::span<const SurfaceSample> samples() const { return samples_; }

  void add_frame(CameraId camera, const Frame& frame) {
    for (size_t i = 0; i < cameras_.size(); ++i) {
      CalibratedCamera& calibration = cameras_[i].calibration;
      const CameraModel& lens = calibration.model;
      if (cameras_[i].id != camera ||
          !HalfSizeFrame::can_store(frame, lens.width(), lens.height())) {
        continue;
      }
      frames_[i].store(frame, lens);
      const CameraPlacePtr& place = frame.info().place;
      if (place) calibration.world_from_camera = place->world_from_camera;
    }
  }

  double correlation(const Observation& observation, const Rigid3& world_from_object) const {
    for (size_t i = 0; i < cameras_.size(); ++i) {
      if (cameras_[i].id != observation.camera || !frames_[i].valid ||
          frames_[i].info.capture != observation.capture)
        continue;
      return correlation(i, world_from_object);
    }
    return 0;
  }

  double correlation(const Rigid3& world_from_object, const Vector6& twist, Time time) const {
    double sum = 0;
    int shown = 0;
    for (size_t i = 0; i < cameras_.size(); ++i) {
      if (!frames_[i].valid) continue;
      const double seconds = to_seconds(frames_[i].info.capture - time);
      const double here = correlation(i, world_from_object * Rigid3::exp(twist * seconds));
      sum += here;
      shown += here != 0;
    }
    return shown > 0 ? sum / shown : 0;
  }

  void compare(const ShapeSymmetry& shape_symmetry, Detection& detection) const {
    for (Observation& observation : detection.observations) {
      if (observation.hypotheses.empty() || shape_symmetry.rotations.empty()) continue;
      const Rigid3 pose = observation.hypotheses.front().world_from_object;
      std::vector<PoseHypothesis> compared;
      double best = correlation(observation, pose);
      compared.push_back({pose, correlation_cost(best)});
      for (const Rigid3& turn : shape_symmetry.rotations) {
        const double other = correlation(observation, pose * turn);
        compared.push_back({pose * turn, correlation_cost(other)});
        best = std::max(best, other);
      }
      if (best >= kMinCorrelation) observation.symmetric_hypotheses = std::move(compared);
    }
  }

  void resolve(Detection& detection) const {
    if (detection.poses.size() < 2) return;
    std::vector<double> correlations(detection.poses.size(), 0);
    for (const Observation& observation : detection.observations) {
      for (size_t k = 0; k < correlations.size() && k < observation.hypotheses.size(); ++k) {
        correlations[k] += correlation(observation, observation.hypotheses[k].world_from_object) /
                           static_cast<double>(detection.observations.size());
      }
    }
    const double best = *std::max_element(correlations.begin(), correlations.end());
    if (best < kMinCorrelation) return;
    for (size_t k = correlations.size(); k-- > 0;) {
      if (correlations[k] < best - kClearlyWorse) drop(k, detection);
    }
  }

 private:
  double correlation(size_t camera, const Rigid3& world_from_object) const {
    const CalibratedCamera& calibration = cameras_[camera].calibration;
    const HalfSizeImage& image = frames_[camera].image;
    const std::array<PlaneView, 3> planes = {image.view(0), image.view(1), image.view(2)};
    return color_correlation(samples_, calibration.model,
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

  const std::vector<SurfaceSample> samples_;
  std::vector<DetectorCamera> cameras_;  ///< those that turn: as in their newest frame
  std::vector<HalfSizeFrame> frames_;    ///< newest, by camera
};

Result<std::unique_ptr<ColorVerifier>> ColorVerifier::create(std::vector<SurfaceSample> samples,
                                                             std::vector<DetectorCamera> cameras) {
  if (samples.size() < kMinColorSamples) {
    return make_error(ErrorCode::kInvalidInput, "color verifier",
                      "{} surface samples, {} are needed", samples.size(), kMinColorSamples);
  }
  return std::unique_ptr<ColorVerifier>(
      new ColorVerifier(std::make_unique<Impl>(std::move(samples), std::move(cameras))));
}

ColorVerifier::ColorVerifier(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ColorVerifier::~ColorVerifier() = default;

std::span<const SurfaceSample> ColorVerifier::samples() const { return impl_->samples(); }
void ColorVerifier::add_frame(CameraId camera, const Frame& frame) {
  impl_->add_frame(camera, frame);
}
double ColorVerifier::correlation(const Observation& observation,
                                  const Rigid3& world_from_object) const {
  return impl_->correlation(observation, world_from_object);
}
double ColorVerifier::correlation(const Rigid3& world_from_object, const Vector6& twist,
                                  Time time) const {
  return impl_->correlation(world_from_object, twist, time);
}
void ColorVerifier::resolve(Detection& detection) const { impl_->resolve(detection); }
void ColorVerifier::compare(const ShapeSymmetry& shape_symmetry, Detection& detection) const {
  impl_->compare(shape_symmetry, detection);
}

}  // namespace sightline
