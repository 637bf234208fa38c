// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "observe/scene/background_colors.hpp"
#include "sightline/model/occlusion_depth.hpp"

namespace sightline::observe {

/// What a cell's color says of an object that should be there.
struct CellEvidence {
  float seen = 0;           ///< -1 surely not there .. 1 surely there; 0: cannot tell
  bool background = false;  ///< not there because the background shows
};

/// For every cell of an image the inverse depth beyond which objects were found hidden, and how
/// sure that is. Evidence adds up from frame to frame and has to pass a threshold either way, so
/// that nothing flickers.
class OcclusionCells {
 public:
  OcclusionCells(int width, int height);

  enum class Change : uint8_t { kNone, kLearned, kForgotten };
  /// Evidence about an object at inverse depth `w` [1/m].
  Change judge(int x, int y, float w, const CellEvidence& evidence);
  /// True if an object there at `w` counts as hidden.
  bool hides(int x, int y, float w) const;
  /// The same, and what hides it is part of the scene.
  bool scene_hides(int x, int y, float w) const;
  /// An object has left the cell: what passed in front of it is forgotten, what stands there is
  /// not.
  void left(int x, int y);
  /// The same for all cells.
  void forget_passing();

  /// Bounds in `rect` for the renderer; cells of which nothing is known take the highest of their
  /// neighbors. False if all are 0.
  bool publish(const CellRect& rect, OcclusionDepth& out) const;

 private:
  struct Cell {
    float bound = 0;       ///< 0: nothing known to hide
    float belief = 0;      ///< leaking sum of evidence; negative: hidden
    bool passing = false;  ///< the bound is of something that is not part of the scene
  };
  size_t at(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x);
  }
  float neighbors(int x, int y) const;

  int width_, height_;
  std::vector<Cell> cells_;
};

}  // namespace sightline::observe
