// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "observe/track/line_fit.hpp"
#include "observe/track/placed_outline.hpp"
#include "observe/track/texture_points.hpp"

namespace sightline::observe {

/// The texture points found at a fitted pose, as a term of kind "texture" or "sparse_texture".
class TextureMeasurement {
 public:
  explicit TextureMeasurement(const TrackerCamera& camera) : camera_(camera) {}

  /// `starts`: poses world_from_object that points are searched around, from the second on only
  /// while few are found; with `rounds` of more than one around each once more from where they
  /// lead. Null if too few points agree; of kind "sparse_texture" if less than `enough` do.
  /// `error`: what all may be wrong by together. `used`: points of the term, or that agreed.
  PoseTermPtr measure(const PlaneView& gray, const PosePrior& prior, std::span<const Rigid3> starts,
                      int rounds, const Occluders& occluders, bool ambiguous,
                      const ViewError& error, size_t enough, TexturePoints& points, int& used);
  /// The pose of the last term, with the prior.
  const Rigid3& pose() const { return pose_; }

 private:
  /// Into found_ and at_, from the best of the starts.
  void find(const PlaneView& gray, const PosePrior& prior, std::span<const Rigid3> starts,
            int rounds, const Occluders& occluders, bool ambiguous, TexturePoints& points);
  /// Into residuals_, by the pose at_; false if one cannot be projected.
  bool linearize();

  const TrackerCamera& camera_;
  Rigid3 pose_;
  Rigid3 at_;
  std::vector<TexturePoints::Found> found_;
  std::vector<LineResidual> residuals_;
  std::vector<double> scratch_;
};

}  // namespace sightline::observe
