// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "draw.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/render/raster.hpp"
#include "sightline/render/static_depth.hpp"

namespace sightline::marks {

/// The geometry of the vector marks: what lies where in the picture, and the pens it is drawn with.

/// How marks look in the object's present state.
struct Look {
  Yuv color;
  Yuv xray_color;
  float line_px = 2;
  bool dashed = false;  ///< coasting
  draw::Dash dash() const { return dashed ? kDash : draw::Dash{}; }
  static constexpr draw::Dash kDash{8, 6};
};

/// Says whether the static scene hides something at that frame pixel.
class SceneTest {
 public:
  /// Things at 1/z = `inverse_depth` are hidden where the scene's is `factor` times that.
  SceneTest(const StaticDepth* scene, double inverse_depth, float factor)
      : scene_(scene), threshold_(static_cast<float>(inverse_depth) * factor) {}
  bool hides(float x, float y) const;

 private:
  const StaticDepth* scene_;
  float threshold_;
};

/// The circle around the picture of a sphere: centred at the picture of its centre, through the
/// points of its silhouette as the lens shows them. Empty if the centre does not project or the
/// camera is inside.
struct Circle {
  draw::Point center;
  float radius;
};
std::optional<Circle> sphere_circle(const CameraModel& model,
                                    const Eigen::Vector3d& center_in_camera, double radius);

/// Appends the 12 edges of the axis-aligned box `low`..`high` of the object's frame. An edge is
/// marked hidden if both its faces look away from the camera.
void box_edges(const RayTable& rays, const Rigid3& camera_from_object, const Eigen::Vector3d& low,
               const Eigen::Vector3d& high, std::vector<EdgeSegment>& out);

/// Scratch of the functions below; keeps its memory.
using Points = std::vector<draw::Point>;

/// Dark rim under lines and markers that are drawn next, 1 px wider on either side.
draw::Pen halo_of(const draw::Pen& pen);

/// Draws pieces, joining those of one line; hidden ones are dashed if `hidden_dashed`, else left
/// out. Behind the scene: the x-ray hue, dimmer.
void draw_pieces(const draw::Canvas& canvas, std::span<const EdgeSegment> pieces, const Look& look,
                 const SceneTest& scene, bool hidden_dashed, bool halo, Points& points);

void draw_circle(const draw::Canvas& canvas, const Circle& circle, const Look& look);
/// Upright rectangle, given by pixel edges.
void draw_box2d(const draw::Canvas& canvas, const draw::Point& low, const draw::Point& high,
                const Look& look);

/// Where the arrow of an object outside the picture points, and where it sits.
struct Arrow {
  draw::Point tip;
  Eigen::Vector2f direction;  ///< unit
};
/// The direction is that in which the camera would have to turn; straight behind: down.
Arrow offscreen_arrow(const CameraModel& model, const Eigen::Vector3d& center_in_camera,
                      float inset_px);
void draw_arrow(const draw::Canvas& canvas, const Arrow& arrow, float size_px, Yuv color);

}  // namespace sightline::marks
