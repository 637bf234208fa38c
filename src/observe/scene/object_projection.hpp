// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "observe/scene/background_colors.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/model/depth_renderer.hpp"

namespace sightline::observe {

/// The cells of a camera's image, and their viewing rays.
class CellGrid {
 public:
  explicit CellGrid(const CameraModel& camera);
  int width() const { return width_; }
  int height() const { return height_; }
  /// Larger by so many cells on every side, cut to the image.
  CellRect grown(const CellRect& rect, int by) const;
  /// Camera frame, at inverse depth `w` [1/m].
  Eigen::Vector3d point_in_camera(int x, int y, float w) const;

 private:
  int width_, height_;
  std::vector<Eigen::Vector2f> rays_;  // x/z, y/z of every cell's center
};

/// One object in one frame, cell by cell.
class ObjectProjection {
 public:
  /// Takes over the depth image of the object at this pose. False if none of it is in the image.
  bool project(const CellGrid& grid, const DepthTile& tile, const Rigid3& camera_from_object);
  void clear() { rect_ = {}; }

  const CellRect& rect() const { return rect_; }
  size_t size() const { return depth_.size(); }
  /// Index of a cell of rect().
  size_t at(int x, int y) const {
    return static_cast<size_t>(y - rect_.top) * static_cast<size_t>(rect_.right - rect_.left) +
           static_cast<size_t>(x - rect_.left);
  }
  /// Inverse depth [1/m]; 0: not covered.
  float depth(size_t cell) const { return depth_[cell]; }
  float depth_at(int x, int y) const { return rect_.contains(x, y) ? depth_[at(x, y)] : 0; }
  /// Covered, and so are all neighbors.
  bool inside(size_t cell) const { return inside_[cell] != 0; }
  const Rigid3& object_from_camera() const { return object_from_camera_; }

 private:
  CellRect rect_;
  Rigid3 object_from_camera_;
  std::vector<float> depth_;
  std::vector<uint8_t> inside_;
};

}  // namespace sightline::observe
