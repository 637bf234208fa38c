// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "sightline/model/object.hpp"

namespace sightline::observe {

/// Where the markers and the inner chessboard corners of a ChArUco board are, in the board's frame
/// (origin at the top-left outer corner of the print, x right, y down).
///
/// There are two layouts. Prints made with OpenCV from 4.6 on start with a dark square at the
/// top-left; older prints of boards with an even number of rows start with a marker there. For odd
/// numbers of rows both are the same.
class BoardLayout {
 public:
  /// `marker_first`: the older layout.
  BoardLayout(const CharucoBoard& board, bool marker_first);

  /// Corners of marker `id` [m]: top-left, top-right, bottom-right, bottom-left.
  const std::array<Eigen::Vector2d, 4>& marker(int id) const {
    return markers_[static_cast<size_t>(id)].corners;
  }
  int markers() const { return static_cast<int>(markers_.size()); }
  /// Inner corners, row by row.
  int corners() const { return (board_.columns - 1) * (board_.rows - 1); }
  Eigen::Vector2d corner(int index) const;
  /// Ids of the two markers whose squares touch a corner.
  std::array<int, 2> markers_at(int corner) const;
  /// True if those squares are the ones up-left and down-right of the corner.
  bool markers_on_main_diagonal(int corner) const;

 private:
  struct Marker {
    int column = 0, row = 0;
    std::array<Eigen::Vector2d, 4> corners;
  };
  int marker_in(int column, int row) const;

  CharucoBoard board_;
  std::vector<Marker> markers_;
  std::vector<int> by_square_;  // marker id of a square, -1 for none
};

}  // namespace sightline::observe
