// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/model/lookalikes.hpp"
#include "sightline/observe/object_detector.hpp"
#include "sightline/observe/surface_spot.hpp"

namespace sightline {

/// Decides between poses that outline and edges cannot tell apart, by the colours that the mesh has
/// been given. A hint: colours are compared by how they vary over the object, never by their level,
/// and where they do not decide nothing changes. One thread at a time.
class SurfaceLook {
 public:
  /// Refused: less than 50 spots. `cameras` as the detector has them.
  static Result<std::unique_ptr<SurfaceLook>> create(std::vector<SurfaceSpot> spots,
                                                     std::vector<DetectorCamera> cameras);
  ~SurfaceLook();

  /// Remembers the frame at half size, as ObjectDetector::add_frame() does.
  void add_frame(CameraId camera, const Frame& frame);

  /// Correlation of colours and picture at a pose, -1..1, in the observation's frame; 0 if that is
  /// not its camera's newest, or shows too little.
  double likeness(const Observation& observation, const Rigid3& world_from_object) const;

  /// Takes away poses that look clearly less like the object than the best one does.
  void resolve(Detection& detection) const;
  /// Fills Observation::alike: what the colours say of the best pose and of those that its shape
  /// cannot tell from it.
  void compare(const Lookalikes& lookalikes, Detection& detection) const;

 private:
  class Impl;
  explicit SurfaceLook(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
