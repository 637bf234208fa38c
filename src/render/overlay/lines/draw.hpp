// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>

#include "sightline/image/planes.hpp"
#include "sightline/render/overlay/overlay_style.hpp"

namespace sightline::draw {

/// Anti-aliased lines straight into a frame. A thin line touches few pixels, so drawing it in place
/// costs less than any tile around it.

/// Pixel coordinates, (0,0) at the center of the top-left pixel.
using Point = Eigen::Vector2f;

/// I420 and NV12 alike: chroma samples of a row are `chroma_step` bytes apart.
struct Canvas {
  MutablePlaneView y;
  uint8_t* u = nullptr;
  uint8_t* v = nullptr;
  ptrdiff_t u_stride = 0;
  ptrdiff_t v_stride = 0;
  int chroma_step = 1;
  int chroma_width() const { return (y.width + 1) / 2; }
  int chroma_height() const { return (y.height + 1) / 2; }
};
Canvas canvas_of(const MutableI420View& image);
Canvas canvas_of(const MutableNv12View& image);

struct Stroke {
  Yuv color;
  float width = 2;    ///< [px]
  float opacity = 1;  ///< 0..1
  bool luma_only = false;
};

/// Lengths along the line [px]; off = 0: solid.
struct Dash {
  float on = 0;
  float off = 0;
};

/// Coverage is the box-filtered distance to the line, in luma with 1 px and in chroma (half a pixel
/// wider) with 2 px, so a line of 2 px or more keeps its color after subsampling. Points that are
/// not finite draw nothing; long lines are clipped first.
void line(const Canvas& canvas, Point a, Point b, const Stroke& stroke);

/// Joined segments with square ends; dashes run on around corners.
void polyline(const Canvas& canvas, std::span<const Point> points, const Stroke& stroke,
              Dash dash = {});

/// Circle line of that radius (to the middle of the line).
void circle(const Canvas& canvas, Point center, float radius, const Stroke& stroke);
void dashed_circle(const Canvas& canvas, Point center, float radius, const Stroke& stroke,
                   Dash dash);

/// Filled convex polygon of 3 to 8 corners, either turning direction.
void polygon(const Canvas& canvas, std::span<const Point> corners, Yuv color, float opacity);

}  // namespace sightline::draw
