// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "observe/track/line_fit.hpp"
#include "observe/track/placed_outline.hpp"
#include "observe/track/print/texture_points.hpp"

namespace sightline::observe {

/// The texture points found at a fitted pose, as a term of kind "texture" or "sparse_texture".
class TextureMeasurement {
 public:
  struct Rules {
    ViewError error;    ///< what all points may be wrong by together
    int rounds = 1;     ///< around each start, each from where the points of the one before lead
    size_t enough = 0;  ///< points, that are more than a "sparse_texture"
  };
  TextureMeasurement(const TrackerCamera& camera, const Rules& rules)
      : camera_(camera), rules_(rules) {}

  /// `starts`: poses world_from_object that points are searched around, from the second on only
  /// while few are found. Null if too few points agree. `used`: points of the term, or that agreed.
  /// `moving`: what a rolling shutter shows elsewhere is corrected by its motion (not of points
  /// that were learned from such images: they are off alike); null: not.
  PoseTermPtr measure(const PlaneView& gray, const PosePrior& prior, std::span<const Rigid3> starts,
                      const Occluders& occluders, bool ambiguous, TexturePoints& points, int& used,
                      const PlacedOutline* moving = nullptr);
  /// Points that the last image showed, agreeing or not.
  std::span<const TexturePoints::Found> found() const { return found_; }
  /// The pose of the last term, with the prior.
  const Rigid3& pose() const { return pose_; }

 private:
  /// Into found_ and at_, from the best of the starts.
  void find(const PlaneView& gray, const PosePrior& prior, std::span<const Rigid3> starts,
            const Occluders& occluders, bool ambiguous, TexturePoints& points);
  /// Into residuals_, by the pose at_; false if one cannot be projected.
  bool linearize();
  /// Takes off found_ and residuals_ what a rolling shutter shows farther on.
  void correct_for_rolling(const PlacedOutline& moving);

  const TrackerCamera& camera_;
  const Rules rules_;
  Rigid3 pose_;
  Rigid3 at_;
  std::vector<TexturePoints::Found> found_;
  std::vector<LineResidual> residuals_;
  std::vector<double> scratch_;
};

}  // namespace sightline::observe
