// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "observe/track/silhouettes/silhouette_grid.hpp"

namespace sightline::observe {

/// Tells poses apart whose silhouettes differ only in a small part: a handle that one of them shows
/// beside the body, and another one elsewhere or not at all. The colors of the object are read
/// where all of the poses cover the image, those of the background where none does; both say to
/// which of them the pixels in between belong.
class SilhouetteComparison {
 public:
  /// The object's near_rotations, and its `silhouette` renderers.
  SilhouetteComparison(const TrackerCamera& camera, const TrackedObject& object);

  /// -log likelihood of `pose` (world_from_object) and of pose * near_rotations[i], up to a common
  /// constant. Empty if the image does not tell: the object is out of it, too small, or has the
  /// colors of what is around it. Draws the mesh once for each; allocates nothing once warm.
  const std::vector<double>& compare(const ColorReader& image, const Rigid3& pose,
                                     const Occluders& occluders);

 private:
  bool learn(uint32_t all);

  const TrackedObject& object_;
  SilhouetteGrid grid_;
  std::vector<uint16_t> foreground_, background_;
  ColorHistograms colors_;
  std::vector<double> costs_;
};

}  // namespace sightline::observe
