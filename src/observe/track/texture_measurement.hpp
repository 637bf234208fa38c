// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "observe/track/line_fit.hpp"
#include "observe/track/placed_outline.hpp"
#include "observe/track/texture_points.hpp"

namespace sightline::observe {

/// The texture points found at a fitted pose, as a term of kind "texture".
class TextureMeasurement {
 public:
  explicit TextureMeasurement(const TrackerCamera& camera) : camera_(camera) {}

  /// `fitted`: world_from_object. Null if too few points agree. `error`: what all may be wrong by
  /// together. `used`: points of the term, or that agreed.
  PoseTermPtr measure(const PlaneView& gray, const PosePrior& prior, const Rigid3& fitted,
                      const Occluders& occluders, bool ambiguous, const ViewError& error,
                      TexturePoints& points, int& used);
  /// The pose of the last term, with the prior.
  const Rigid3& pose() const { return pose_; }

 private:
  const TrackerCamera& camera_;
  Rigid3 pose_;
  std::vector<LineResidual> residuals_;
  std::vector<double> scratch_;
};

}  // namespace sightline::observe
