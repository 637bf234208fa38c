// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "sightline/geometry/camera_model.hpp"

namespace sightline {

/// The undistorted ray (x/z, y/z) of every pixel center of one camera, computed once. The
/// rasterizer evaluates triangles at these rays: there edges are straight and 1/z is linear, so an
/// image through any lens is exact for triangles of any size.
///
/// Pixels whose lens polynomial has no inverse, and fisheye pixels at 89 degrees and more from the
/// axis, hold NaN: nothing is ever drawn there. Immutable after build(); any number of threads.
/// Memory: 8 bytes a pixel (7.4 MB at 1280x720).
class RayTable {
 public:
  /// Bounds of the rays of one block of kBlock x kBlock pixels; min > max where it has no ray.
  struct RayBounds {
    float min_x, max_x, min_y, max_y;
    bool empty() const { return !(min_x <= max_x); }
  };
  static constexpr int kBlock = 16;

  /// About 100 ns a pixel. Any number of threads at a time.
  static std::shared_ptr<const RayTable> build(const CameraModel& model);

  const CameraModel& model() const { return model_; }
  int width() const { return model_.width(); }
  int height() const { return model_.height(); }
  /// Size rounded up to even numbers: tiles may reach this far (rays out there are NaN).
  int even_width() const { return (width() + 1) & ~1; }
  int even_height() const { return (height() + 1) & ~1; }

  /// Rows 0 .. even_height() - 1; at least 16 values past even_width() may be read (NaN).
  const float* x_row(int y) const { return x_.data() + static_cast<size_t>(y) * stride_; }
  const float* y_row(int y) const { return y_.data() + static_cast<size_t>(y) * stride_; }
  size_t stride() const { return stride_; }

  int block_columns() const { return block_columns_; }
  int block_rows() const { return block_rows_; }
  const RayBounds& block(int column, int row) const {
    return blocks_[static_cast<size_t>(row) * static_cast<size_t>(block_columns_) +
                   static_cast<size_t>(column)];
  }
  const RayBounds& frame_bounds() const { return frame_bounds_; }
  /// The largest hypot(x/z, y/z) in the table, and of the region where project() answers: a little
  /// beyond the image, never beyond the fold-over.
  double max_ray_radius() const { return max_ray_radius_; }
  double project_limit() const { return project_limit_; }

  /// Double-precision ray of any pixel position, by Newton's method on the lens equations from
  /// `start` (a ray nearby). Empty where it does not converge inside project_limit().
  std::optional<Eigen::Vector2d> solve_ray(double px, double py,
                                           const Eigen::Vector2d& start) const;
  /// Ray of a pixel of the table in double precision; empty where the table holds NaN.
  std::optional<Eigen::Vector2d> exact_ray(int px, int py) const;

  /// Pixel of a ray through the exact lens; empty beyond project_limit().
  std::optional<Eigen::Vector2d> project(const Eigen::Vector2d& ray) const;

  /// Upper bound of |d2 pixel / d ray2| [px] over rays of radius `min_radius` .. `max_radius`
  /// (clamped to project_limit()): a straight line of length L in ray space bends by at most
  /// bound * L^2 / 8 in the image.
  double curvature_bound(double min_radius, double max_radius) const;

  /// Piecewise linear copy of the radial factor over s = 1 - 1 / sqrt(1 + r^2), for bounding boxes:
  /// factor(s) = value[i] + (s * scale - i) * step[i].
  struct RadialLookup {
    static constexpr int kCells = 1024;
    std::vector<float> value, step;
    float scale = 0;     ///< cells per unit of s
    float error_px = 0;  ///< bound of the pixel error made by the lookup
    float p1 = 0, p2 = 0;
    float fx = 0, fy = 0, cx = 0, cy = 0;
  };
  const RadialLookup& lookup() const { return lookup_; }

 private:
  explicit RayTable(const CameraModel& model);
  void fill_rays();
  void fill_blocks();
  void fill_lookup();
  void fill_curvature();

  CameraModel model_;
  size_t stride_ = 0;
  std::vector<float> x_, y_;
  int block_columns_ = 0, block_rows_ = 0;
  std::vector<RayBounds> blocks_;
  RayBounds frame_bounds_{};
  double max_ray_radius_ = 0;
  double project_limit_ = 0;
  RadialLookup lookup_;
  std::vector<double> curvature_to_, curvature_from_;  ///< running maxima from both ends
};

}  // namespace sightline
