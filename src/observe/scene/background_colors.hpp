// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "observe/scene/background_cells.hpp"
#include "observe/scene/cell_reader.hpp"

namespace sightline::observe {

/// Cells of an image, end excluded.
struct CellRect {
  int left = 0, top = 0, right = 0, bottom = 0;
  bool empty() const { return left >= right || top >= bottom; }
  bool contains(int x, int y) const { return x >= left && x < right && y >= top && y < bottom; }
};

/// The background as the occlusion learner asks for it: learned wherever no object can be, in the
/// light that there is, with distances that allow for an object's shadow. Where the image still
/// looks like that although an object should be in front of it, the object is not in front of it.
class BackgroundColors {
 public:
  BackgroundColors(int width, int height);

  /// Takes the cells outside `objects`; all of them at first, later one row in eight a frame.
  void learn(const CellReader& frame, std::span<const CellRect> objects);
  bool known(int x, int y) const { return cells_.known(cells_.index(x, y)); }
  /// Share of the known cells that differed in the frame learned last. Where that is most of them,
  /// the light or the camera has changed, or something covers the whole image.
  float changed() const { return changed_; }
  /// True if the background varies around the cell, so that nothing else resembles it by chance.
  bool textured(int x, int y) const;
  /// True if the background has about the same color at two cells: perhaps one thing.
  bool similar(int x0, int y0, int x1, int y1) const;
  /// Squared distance of a color from the background, in standard deviations. A shadow changes the
  /// brightness by some percent, so that much is allowed for.
  float distance(int x, int y, const CellColor& color) const;

 private:
  /// Known cells that a frame was compared with, and those of them that differed.
  struct Tally {
    int compared = 0, differing = 0;
  };
  void take(int x, int y, const CellColor& color, Tally& tally);

  BackgroundCells cells_;
  int frames_ = 0;
  float changed_ = 0;
};

}  // namespace sightline::observe
