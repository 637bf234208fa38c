// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "observe/scene/background_colors.hpp"
#include "observe/scene/object_projection.hpp"
#include "observe/scene/occlusion_cells.hpp"
#include "observe/scene/surface_colors.hpp"

namespace sightline::observe {

/// What the colors of a frame say, cell by cell, of an object that should be there: the likelihood
/// of each under what is known of the object's surface against the background's and anything
/// else's (docs/overlay.md). Buffers are kept from object to object.
class OcclusionEvidence {
 public:
  /// What is known before the frame.
  struct Knowledge {
    const CellGrid& grid;
    const BackgroundColors& background;
    const OcclusionCells& cells;
    /// Most of the image differs from the background: then a change at one cell says nothing.
    bool image_changed = false;
  };

  /// Compares the frame with the object's projection; cells at which one of `others` is nearer say
  /// nothing.
  void measure(const Knowledge& known, const ObjectProjection& projection,
               const SurfaceColors& surface, const CellReader& frame,
               std::span<const ObjectProjection* const> others);

  /// The mean around a cell of the projection, from -1 (surely not there) to 1.
  CellEvidence mean_at(const ObjectProjection& projection, int x, int y) const;
  /// True if this very cell shows the object.
  bool shows_object(size_t cell) const { return valid_[cell] != 0 && evidence_[cell] > 0; }

 private:
  /// Logarithm of how much better the object explains a cell than the background or anything else
  /// does; empty: nothing is known to compare with.
  struct Cell {
    std::optional<float> log_ratio;
    bool background = false;  ///< it looks like the background
    bool guessed = false;     ///< ... and of the object's surface there nothing is known
  };
  static Cell compare(const Knowledge& known, const SurfaceColors& surface, size_t place, int x,
                      int y, const CellColor& color);
  void spread(const Knowledge& known, const ObjectProjection& projection);
  void reject_if_covered(const ObjectProjection& projection);

  std::vector<float> evidence_;
  std::vector<uint8_t> valid_, background_, guessed_, spread_;
};

}  // namespace sightline::observe
