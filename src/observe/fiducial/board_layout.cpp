// SPDX-License-Identifier: Apache-2.0
#include "observe/fiducial/board_layout.hpp"

namespace sightline::observe {

BoardLayout::BoardLayout(const CharucoBoard& board, bool marker_first)
    : board_(board), by_square_(static_cast<size_t>(board.columns * board.rows), -1) {
  const double inset = (board.square - board.marker) / 2;
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      if (((row + column) % 2 == 0) != marker_first) continue;
      const double left = column * board.square + inset;
      const double top = row * board.square + inset;
      const double side = board.marker;
      by_square_[static_cast<size_t>(row * board.columns + column)] = markers();
      markers_.push_back(
          {column,
           row,
           {Eigen::Vector2d(left, top), Eigen::Vector2d(left + side, top),
            Eigen::Vector2d(left + side, top + side), Eigen::Vector2d(left, top + side)}});
    }
  }
}

Eigen::Vector2d BoardLayout::corner(int index) const {
  const int columns = board_.columns - 1;
  return board_.square * Eigen::Vector2d(index % columns + 1, index / columns + 1);
}

int BoardLayout::marker_in(int column, int row) const {
  return by_square_[static_cast<size_t>(row * board_.columns + column)];
}

bool BoardLayout::markers_on_main_diagonal(int corner) const {
  const int columns = board_.columns - 1;
  return marker_in(corner % columns, corner / columns) >= 0;
}

std::array<int, 2> BoardLayout::markers_at(int corner) const {
  const int column = corner % (board_.columns - 1);
  const int row = corner / (board_.columns - 1);
  if (markers_on_main_diagonal(corner)) {
    return {marker_in(column, row), marker_in(column + 1, row + 1)};
  }
  return {marker_in(column + 1, row), marker_in(column, row + 1)};
}

}  // namespace sightline::observe
