// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "cell_reader.hpp"

namespace sightline::observe {

/// Cells of a picture, end excluded.
struct CellRect {
  int left = 0, top = 0, right = 0, bottom = 0;
  bool empty() const { return left >= right || top >= bottom; }
  bool contains(int x, int y) const { return x >= left && x < right && y >= top && y < bottom; }
};

/// What a fixed camera sees at every cell while no object is there: running mean and noise of each
/// colour (Wren et al., "Pfinder", 1997, with one Gaussian a cell). Where the picture still looks
/// like that although an object should be in front of it, the object is not in front of it.
class StillColors {
 public:
  StillColors(int width, int height);

  /// Takes the cells outside `objects`; all of them at first, later one row in eight a frame.
  void learn(const CellReader& frame, std::span<const CellRect> objects);
  bool known(int x, int y) const { return cells_[at(x, y)].seen >= kFewest; }
  /// Share of the known cells that looked otherwise in the frame learned last. Where that is most
  /// of them, the light or the camera has changed, or something covers the whole picture.
  float changed() const { return changed_; }
  /// True if the scene varies around the cell, so that nothing else looks like it by chance.
  bool varied(int x, int y) const;
  /// True if the scene looks alike at two cells: perhaps one thing.
  bool alike(int x0, int y0, int x1, int y1) const;
  /// Squared distance of a colour from what is known, in standard deviations. A shadow that falls
  /// on a thing changes its brightness by some percent, so that much is allowed for.
  float distance(int x, int y, const CellColor& color) const;

 private:
  static constexpr uint8_t kFewest = 4;
  struct Cell {
    float y = 0, u = 0, v = 0;
    float noise = 0;  ///< mean absolute deviation of luma
    uint8_t seen = 0;
  };
  size_t at(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x);
  }
  static void mix(Cell& cell, const CellColor& color);
  void take(int x, int y, const CellColor& color, int& looked, int& changed);

  int width_, height_;
  int frames_ = 0;
  float changed_ = 0;
  std::vector<Cell> cells_;
};

}  // namespace sightline::observe
