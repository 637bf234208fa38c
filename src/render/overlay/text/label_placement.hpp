// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "sightline/render/raster/tile.hpp"

namespace sightline::render {

/// A box of frame pixels around what was drawn of an object; the label goes beside it.
struct Extent {
  float left, top, right, bottom;
};

/// Where the texts of one frame go, so that they do not lie over one another while there is room.
/// Each text has a usual place and others around it, and takes the first that no earlier text of
/// the frame has; if there is none, the usual one. From frame to frame a text moves back to a
/// better place only once that is free with room to spare, so that it does not jump to and fro.
/// The same sequence of calls gives the same places. Nothing allocates after construction.
class LabelPlacement {
 public:
  /// `slots`: how many texts beside objects there may be, each known by its number.
  LabelPlacement(int frame_width, int frame_height, size_t slots);

  /// A new frame: nothing is taken.
  void begin();

  /// The next of the lines in the top left corner, below those before it.
  TileRect corner_line(int width, int height);
  /// A text beside a box: above it if there is room, else below; else along its other edges.
  TileRect beside(size_t slot, const Extent& extent, int width, int height);
  /// A text whose corner is best at (x, y); else a little above, below, left or right of there.
  TileRect near(size_t slot, int x, int y, int width, int height);

  /// The corner at which a text of this size lies inside a frame, as close to (x, y) as can be;
  /// even, as tiles are.
  static TileRect inside(int frame_width, int frame_height, int x, int y, int width, int height);

 private:
  class Candidates;
  TileRect choose(size_t slot, const Candidates& candidates);
  TileRect take(const TileRect& rect);
  TileRect inside(int x, int y, int width, int height) const {
    return inside(frame_width_, frame_height_, x, y, width, height);
  }
  bool free(const TileRect& rect, int spare_px) const;

  int frame_width_, frame_height_;
  int corner_y_ = 0;
  std::vector<TileRect> taken_;
  std::vector<size_t> last_;  ///< by slot: which of its candidates it took last
};

}  // namespace sightline::render
