// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <span>

#include "hidden_surfaces/scene.hpp"

namespace sightline::hidden_surfaces {

/// Calls pixel(x, y) for each pixel center in a convex polygon of the image, inside the tile. Two
/// polygons that share an edge share no pixel and leave none out: rows and columns are half open,
/// and an edge crosses a row at the same place for both.
template <typename Pixel>
void fill(std::span<const Eigen::Vector2d> polygon, const Tile& tile, const Pixel& pixel) {
  double top = polygon[0].y(), bottom = top;
  for (const Eigen::Vector2d& point : polygon) {
    top = std::min(top, point.y());
    bottom = std::max(bottom, point.y());
  }
  const int first = std::max(tile.y, static_cast<int>(std::ceil(top)));
  const int end = std::min(tile.y + tile.height, static_cast<int>(std::ceil(bottom)));
  for (int y = first; y < end; ++y) {
    double left = 1e9, right = -1e9;
    for (size_t i = 0; i < polygon.size(); ++i) {
      const Eigen::Vector2d *a = &polygon[i], *b = &polygon[(i + 1) % polygon.size()];
      if (a->y() > b->y()) std::swap(a, b);
      if (y < a->y() || y >= b->y()) continue;
      const double x = a->x() + (y - a->y()) * (b->x() - a->x()) / (b->y() - a->y());
      left = std::min(left, x);
      right = std::max(right, x);
    }
    const int from = std::max(tile.x, static_cast<int>(std::ceil(left)));
    const int to = std::min(tile.x + tile.width, static_cast<int>(std::ceil(right)));
    for (int x = from; x < to; ++x) pixel(x, y);
  }
}

}  // namespace sightline::hidden_surfaces
