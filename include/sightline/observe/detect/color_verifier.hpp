// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/model/shape_symmetry.hpp"
#include "sightline/observe/shape/surface_sample.hpp"
#include "sightline/observe/terms/detection.hpp"

namespace sightline {

/// Decides between poses that outline and edges cannot tell apart, by the colors that the mesh has
/// been given. A hint: colors are compared by how they vary over the object, never by their level,
/// and where they do not decide nothing changes. One thread at a time.
class ColorVerifier {
 public:
  /// Refused: less than 50 samples. `cameras` as the detector has them.
  static Result<std::unique_ptr<ColorVerifier>> create(std::vector<SurfaceSample> samples,
                                                       std::vector<DetectorCamera> cameras);
  ~ColorVerifier();

  /// Of the surface, as given.
  std::span<const SurfaceSample> samples() const;

  /// Keeps the frame at half size, as ObjectDetector::add_frame() does.
  void add_frame(CameraId camera, const Frame& frame);

  /// Correlation of colors and image at a pose, -1..1, in the observation's frame; 0 if that is
  /// not its camera's newest, or shows too little.
  double correlation(const Observation& observation, const Rigid3& world_from_object) const;

  /// The same of an object that moves, in the newest frame of each camera that shows it, the mean:
  /// the pose is at `time`.
  double correlation(const Rigid3& world_from_object, const Vector6& twist, Time time) const;

  /// Takes away poses whose correlation is clearly below that of the best one.
  void resolve(Detection& detection) const;
  /// Fills Observation::symmetric_hypotheses: what the colors say of the best pose and of those
  /// that its shape cannot tell from it.
  void compare(const ShapeSymmetry& shape_symmetry, Detection& detection) const;

 private:
  class Impl;
  explicit ColorVerifier(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
