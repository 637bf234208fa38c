// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/image/planes.hpp"
#include "sightline/model/scene_points.hpp"
#include "sightline/render/overlay/overlay_style.hpp"

namespace sightline {

/// A reconstructed point as one image shows it.
struct PointMark {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double depth = 0;  ///< [m], along the camera's axis; chooses the color
  PointKind kind = PointKind::kPoint;
  bool hidden = false;  ///< behind a surface: an open, paler mark
};

/// Depths that get the ends of the color scale [m]. Far must lie beyond near.
struct DepthScale {
  double near_m = 0;
  double far_m = 1;
};
/// The scale that fits the marks: nearest to farthest, at least 1 mm apart. Unused marks count.
DepthScale fit_depth_scale(std::span<const PointMark> marks);
/// Near green, over yellow-green and cyan, far blue.
Rgb depth_color(double depth, const DepthScale& scale);

struct PointMarkStyle {
  float edge_px = 3;    ///< side of the square that marks an edge point, 2..32
  float corner_px = 9;  ///< diameter of the ring that marks a corner, 4..64
};

/// Marks for hundreds of points on an object of a hundred pixels.
inline constexpr PointMarkStyle kManyPoints{2, 5};

/// Appends what of the points a camera's image shows.
void marks_of_points(const CameraModel& camera, const Rigid3& camera_from_world,
                     std::span<const ScenePoint> points, std::vector<PointMark>& out);

/// Draws the marks, far to near so that near ones lie on top. Marks outside the image are left
/// out. Any thread.
void draw_point_marks(const MutableI420View& image, std::span<const PointMark> marks,
                      const DepthScale& scale, const PointMarkStyle& style = {});

/// The smallest circle around the pixels (Welzl, "Smallest enclosing disks", 1991); empty for no
/// pixels. Expected linear time.
struct PixelCircle {
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  double radius = 0;
};
std::optional<PixelCircle> enclosing_circle(std::span<const Eigen::Vector2d> pixels);

/// Bounding markers with a dark rim, `margin_px` away from the pixels. Nothing for no pixels.
void draw_bounding_circle(const MutableI420View& image, std::span<const Eigen::Vector2d> pixels,
                          Rgb color, float line_px, double margin_px);
void draw_bounding_rectangle(const MutableI420View& image, std::span<const Eigen::Vector2d> pixels,
                             Rgb color, float line_px, double margin_px);

}  // namespace sightline
