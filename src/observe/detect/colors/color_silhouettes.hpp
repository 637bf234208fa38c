// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "observe/detect/detector_frames.hpp"
#include "observe/detect/silhouette_search.hpp"

namespace sightline::observe {

/// What looks like the object in the cameras that show it, by the colors at one pose, and how well
/// the silhouettes of other poses fit that. Cameras in which its colors as a whole are those of its
/// surroundings take no part.
class ColorSilhouettes {
 public:
  /// `scores`: of the pose, by camera that takes part; those below kMinCameraContour do not show
  /// it.
  ColorSilhouettes(const DetectorFrames& frames, const ViewpointModel& model,
                   const RigMotion& motion, std::span<const double> scores);
  ColorSilhouettes(const ColorSilhouettes&) = delete;
  ColorSilhouettes& operator=(const ColorSilhouettes&) = delete;

  std::span<const SilhouetteCamera> cameras() const { return cameras_; }
  /// Mean overlap over union of the cameras that can say; negative: none can.
  double overlap(const SilhouetteSearch& silhouettes, const RigMotion& motion) const;

 private:
  std::vector<ForegroundMap> maps_;
  std::vector<double> seconds_;
  std::vector<SilhouetteCamera> cameras_;
};

}  // namespace sightline::observe
