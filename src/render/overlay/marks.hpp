// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "render/overlay/lines/draw.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/render/raster/raster.hpp"
#include "sightline/render/raster/static_depth.hpp"

namespace sightline::marks {

/// The geometry of the vector marks: what lies where in the image, and the strokes it is drawn
/// with.

/// How marks look in the object's present state.
struct LineStyle {
  Yuv color;
  Yuv xray_color;
  float line_px = 2;
  bool dashed = false;  ///< coasting
  float halo = 0.5f;    ///< opacity of the dark rim
  draw::Dash dash() const { return dashed ? kDash : draw::Dash{}; }
  static constexpr draw::Dash kDash{8, 6};
};

/// The circle around the image of a sphere: centered at the image of its center, through the
/// points of its silhouette as the lens shows them. Empty if the center does not project or the
/// camera is inside.
struct Circle {
  draw::Point center;
  float radius;
};
std::optional<Circle> sphere_circle(const CameraModel& model,
                                    const Eigen::Vector3d& center_in_camera, double radius);

/// What draw_pieces() needs to know of a piece, as bits.
enum PieceFlags : uint8_t {
  kTurnedAway = 1,   ///< on the far side of the object: dashed, paler
  kBehindScene = 2,  ///< the static scene hides it: the x-ray hue, dashed
};

/// Pieces of lines and what is known of each; keeps its memory.
struct Pieces {
  std::vector<EdgeSegment> segments;
  std::vector<uint8_t> flags;
  void clear() {
    segments.clear();
    flags.clear();
  }
};

/// Appends a line in space (camera frame), kBehindScene where the occluders' 1/z is `factor`
/// times its own. `occluders` may be null.
void add_line(const RayTable& rays, const RasterTile* occluders, float factor,
              const Eigen::Vector3d& start_in_camera, const Eigen::Vector3d& end_in_camera,
              uint32_t line, uint8_t flags, Pieces& out);

/// Appends the 12 edges of the axis-aligned box `low`..`high` of the object's frame; kTurnedAway if
/// both faces of an edge look away from the camera.
void add_box(const RayTable& rays, const RasterTile* occluders, float factor,
             const Rigid3& camera_from_object, const Eigen::Vector3d& low,
             const Eigen::Vector3d& high, Pieces& out);

/// Scratch of the functions below; keeps its memory.
using Points = std::vector<draw::Point>;

/// Dark rim under lines and markers that are drawn next, 1 px wider on either side.
draw::Stroke halo_of(const draw::Stroke& stroke, float opacity);

/// Draws the pieces, or only their halo, joining those of one line and one line_style.
void draw_pieces(const draw::Canvas& canvas, const Pieces& pieces, const LineStyle& line_style,
                 bool halo, Points& points);

/// Halo and lines.
void draw_with_halo(const draw::Canvas& canvas, const Pieces& pieces, const LineStyle& line_style,
                    Points& points);

void draw_circle(const draw::Canvas& canvas, const Circle& circle, const LineStyle& line_style);
/// Upright rectangle, given by pixel edges.
void draw_box2d(const draw::Canvas& canvas, const draw::Point& low, const draw::Point& high,
                const LineStyle& line_style);

/// Upright cross of two lines, `arm_px` to each side, open in the middle so that what it marks is
/// seen.
void draw_cross(const draw::Canvas& canvas, const draw::Point& center, float arm_px,
                const LineStyle& line_style);

/// Covariance [px^2] of the image of a point of the object [m], by the pose's covariance (tangent
/// rotation, translation on the object's side) through the projection's Jacobian. Empty if the
/// point does not project.
std::optional<Eigen::Matrix2d> pixel_covariance(const CameraModel& model,
                                                const Rigid3& camera_from_object,
                                                const Eigen::Matrix<double, 6, 6>& covariance,
                                                const Eigen::Vector3d& point_in_object);

/// The ellipse of `sigmas` standard deviations, no half axis shorter than a pixel and a half.
void draw_ellipse(const draw::Canvas& canvas, const draw::Point& center,
                  const Eigen::Matrix2d& covariance, double sigmas, const LineStyle& line_style,
                  Points& points);

/// Where the arrow of an object outside the image points, and where it sits.
struct Arrow {
  draw::Point tip;
  Eigen::Vector2f direction;  ///< unit
};
/// The direction is that in which the camera would have to turn; straight behind: down.
Arrow offscreen_arrow(const CameraModel& model, const Eigen::Vector3d& center_in_camera,
                      float inset_px);
void draw_arrow(const draw::Canvas& canvas, const Arrow& arrow, float size_px, Yuv color);

}  // namespace sightline::marks
