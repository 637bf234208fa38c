// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "observe/track/silhouettes/silhouette_grid.hpp"
#include "sightline/model/observation.hpp"

namespace sightline::observe {

/// Asks whether an image shows the whole object and nothing but the object where a pose says: what
/// has the colors of its inside, touches its silhouette from outside and belongs to no other known
/// object is not explained; what has the colors of its surroundings well inside the silhouette is
/// missing. The colors are those of the image itself, so nothing that was learned of a wrong pose
/// hides them. It sees a mesh that is a part of the object, or larger, or of something else.
class PictureCheck {
 public:
  PictureCheck(const TrackerCamera& camera, const TrackedObject& object);

  /// Nothing if the image does not tell: the object is out of it, too small, mostly hidden by what
  /// is known, or has the colors of what is around it. Draws the mesh once; allocates nothing once
  /// warm.
  std::optional<PictureAgreement> examine(const ColorReader& image, const Rigid3& pose,
                                          const Occluders& occluders);
  /// True if most of the object would have to be seen at this pose: it is in the image and nothing
  /// known is in front.
  bool must_show(const ColorReader& image, const Rigid3& pose, const Occluders& occluders);

 private:
  using Cells = std::array<uint8_t, SilhouetteGrid::kCells>;

  /// Steps (8 neighbors) of each cell to the nearest one across the outline.
  void measure_distances();
  bool known(size_t cell) const { return grid_.bins()[cell] != SilhouetteGrid::kUnknown; }
  bool covered(size_t cell) const { return grid_.covered()[cell] != 0; }
  bool learn();
  /// Known cells of the silhouette; none if they are too few, or too small a share of it.
  int shown_cells(double least_share) const;
  double unexplained_cells();
  double missing_cells();
  /// Cells of `wanted_` that are reached from those in `queue_` over 4 neighbors; they are taken
  /// out of it.
  int flood();

  SilhouetteGrid grid_;
  Cells steps_{}, wanted_{};
  std::vector<uint16_t> queue_, foreground_, background_;
  ColorHistograms colors_;
};

}  // namespace sightline::observe
