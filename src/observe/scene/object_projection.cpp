// SPDX-License-Identifier: Apache-2.0
#include "observe/scene/object_projection.hpp"

#include <algorithm>

#include "sightline/model/occlusion_depth.hpp"

namespace sightline::observe {

CellGrid::CellGrid(const CameraModel& camera)
    : width_(camera.width() / OcclusionDepth::kStep),
      height_(camera.height() / OcclusionDepth::kStep),
      rays_(static_cast<size_t>(width_) * static_cast<size_t>(height_)) {
  size_t i = 0;
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      const auto ray = camera.unproject({2 * x + 0.5, 2 * y + 0.5});
      if (ray && ray->z() > 0) rays_[i] = (ray->head<2>() / ray->z()).cast<float>();
      ++i;
    }
  }
}

CellRect CellGrid::grown(const CellRect& rect, int by) const {
  return {std::max(0, rect.left - by), std::max(0, rect.top - by),
          std::min(width_, rect.right + by), std::min(height_, rect.bottom + by)};
}

Eigen::Vector3d CellGrid::point_in_camera(int x, int y, float w) const {
  const Eigen::Vector2f& ray =
      rays_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)];
  return Eigen::Vector3d(static_cast<double>(ray.x()), static_cast<double>(ray.y()), 1) /
         static_cast<double>(w);
}

bool ObjectProjection::project(const CellGrid& grid, const DepthTile& tile,
                               const Rigid3& camera_from_object) {
  clear();
  if (tile.width <= 0) return false;
  object_from_camera_ = camera_from_object.inverse();
  rect_ = grid.grown(
      {tile.x / 2, tile.y / 2, (tile.x + tile.width + 1) / 2, (tile.y + tile.height + 1) / 2}, 0);
  const size_t count = static_cast<size_t>(std::max(0, rect_.right - rect_.left)) *
                       static_cast<size_t>(std::max(0, rect_.bottom - rect_.top));
  depth_.assign(count, 0.0f);
  inside_.assign(count, 0);
  size_t i = 0;
  for (int y = rect_.top; y < rect_.bottom; ++y) {
    for (int x = rect_.left; x < rect_.right; ++x, ++i) {
      const float a = tile.at(2 * x, 2 * y), b = tile.at(2 * x + 1, 2 * y);
      const float c = tile.at(2 * x, 2 * y + 1), d = tile.at(2 * x + 1, 2 * y + 1);
      if (std::min({a, b, c, d}) > 0) depth_[i] = 0.25f * (a + b + c + d);
    }
  }
  for (int y = rect_.top; y < rect_.bottom; ++y) {
    for (int x = rect_.left; x < rect_.right; ++x) {
      bool inside = true;
      for (int ny = y - 1; ny <= y + 1 && inside; ++ny) {
        for (int nx = x - 1; nx <= x + 1 && inside; ++nx) inside = depth_at(nx, ny) > 0;
      }
      inside_[at(x, y)] = inside ? 1 : 0;
    }
  }
  return true;
}

}  // namespace sightline::observe
