// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/overlay/point_marks.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "render/overlay/marks.hpp"

namespace sightline {
namespace {

constexpr double kOutside = 64;  // px beyond the image that a mark may still touch it

draw::Point to_point(const Eigen::Vector2d& pixel) { return pixel.cast<float>(); }

bool near_image(const MutableI420View& image, const Eigen::Vector2d& pixel) {
  return pixel.x() > -kOutside && pixel.y() > -kOutside && pixel.x() < image.width() + kOutside &&
         pixel.y() < image.height() + kOutside;
}

std::array<draw::Point, 4> square(const draw::Point& center, float side) {
  const float h = side / 2;
  return {center + draw::Point(-h, -h), center + draw::Point(h, -h), center + draw::Point(h, h),
          center + draw::Point(-h, h)};
}

void draw_ring(const draw::Canvas& canvas, const PointMark& mark, Yuv color, float diameter) {
  const draw::Point at = to_point(mark.pixel);
  const draw::Stroke stroke{color, 2, mark.hidden ? 0.5f : 1.0f, false};
  draw::circle(canvas, at, diameter / 2, marks::halo_of(stroke, 0.5f));
  draw::circle(canvas, at, diameter / 2, stroke);
  if (!mark.hidden) draw::polygon(canvas, square(at, 2), color, 1);
}

void draw_square(const draw::Canvas& canvas, const PointMark& mark, Yuv color, float side) {
  const draw::Point at = to_point(mark.pixel);
  if (!mark.hidden) {
    draw::polygon(canvas, square(at, side), color, 1);
    return;
  }
  const auto corners = square(at, side);
  std::array<draw::Point, 5> loop;
  std::copy(corners.begin(), corners.end(), loop.begin());
  loop[4] = corners[0];
  draw::polyline(canvas, loop, {color, 1, 0.5f, false});
}

// Two-point and three-point circles of Welzl's algorithm.
PixelCircle circle_of(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return {(a + b) / 2, (a - b).norm() / 2};
}

PixelCircle circle_of(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                      const Eigen::Vector2d& c) {
  const Eigen::Vector2d u = b - a, v = c - a;
  const double cross = 2 * (u.x() * v.y() - u.y() * v.x());
  if (std::abs(cross) < 1e-12 * u.norm() * v.norm()) {  // on one line: the farthest two
    PixelCircle best = circle_of(a, b);
    for (const PixelCircle& other : {circle_of(a, c), circle_of(b, c)}) {
      if (other.radius > best.radius) best = other;
    }
    return best;
  }
  const Eigen::Vector2d offset((v.y() * u.squaredNorm() - u.y() * v.squaredNorm()) / cross,
                               (u.x() * v.squaredNorm() - v.x() * u.squaredNorm()) / cross);
  return {a + offset, offset.norm()};
}

bool holds(const PixelCircle& circle, const Eigen::Vector2d& pixel) {
  return (pixel - circle.center).norm() <= circle.radius * (1 + 1e-12) + 1e-9;
}

struct Box {
  Eigen::Vector2d low, high;
};

Box box_around(std::span<const Eigen::Vector2d> pixels) {
  Box box{pixels.front(), pixels.front()};
  for (const Eigen::Vector2d& pixel : pixels) {
    box.low = box.low.cwiseMin(pixel);
    box.high = box.high.cwiseMax(pixel);
  }
  return box;
}

}  // namespace

DepthScale fit_depth_scale(std::span<const PointMark> marks) {
  if (marks.empty()) return {};
  const auto [low, high] =
      std::minmax_element(marks.begin(), marks.end(),
                          [](const PointMark& a, const PointMark& b) { return a.depth < b.depth; });
  return {low->depth, std::max(high->depth, low->depth + 1e-3)};
}

Rgb depth_color(double depth, const DepthScale& scale) {
  // Hue from 120 deg (green) to 240 deg (blue) at full saturation and value.
  const double share = std::clamp((depth - scale.near_m) / (scale.far_m - scale.near_m), 0.0, 1.0);
  const double green = share < 0.5 ? 1 : 2 - 2 * share;
  const double blue = share < 0.5 ? 2 * share : 1;
  return {0, static_cast<uint8_t>(std::lround(255 * green)),
          static_cast<uint8_t>(std::lround(255 * blue))};
}

void draw_point_marks(const MutableI420View& image, std::span<const PointMark> marks,
                      const DepthScale& scale, const PointMarkStyle& style) {
  const draw::Canvas canvas = draw::canvas_of(image);
  std::vector<size_t> order(marks.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return marks[a].depth > marks[b].depth; });
  for (const size_t i : order) {
    const PointMark& mark = marks[i];
    if (!near_image(image, mark.pixel)) continue;
    const Yuv color = to_yuv(depth_color(mark.depth, scale));
    if (mark.kind == PointKind::kCorner) {
      draw_ring(canvas, mark, color, style.corner_px);
    } else {
      draw_square(canvas, mark, color, style.edge_px);
    }
  }
}

std::optional<PixelCircle> enclosing_circle(std::span<const Eigen::Vector2d> pixels) {
  if (pixels.empty()) return std::nullopt;
  // A fixed shuffle keeps the expected linear time for pixels that come in order along an edge.
  std::vector<Eigen::Vector2d> p(pixels.begin(), pixels.end());
  uint64_t state = 0x9E3779B97F4A7C15ull;
  for (size_t i = p.size(); i > 1; --i) {
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    std::swap(p[i - 1], p[(state >> 33) % i]);
  }
  PixelCircle circle{p[0], 0};
  for (size_t i = 1; i < p.size(); ++i) {
    if (holds(circle, p[i])) continue;
    circle = {p[i], 0};
    for (size_t j = 0; j < i; ++j) {
      if (holds(circle, p[j])) continue;
      circle = circle_of(p[i], p[j]);
      for (size_t k = 0; k < j; ++k) {
        if (!holds(circle, p[k])) circle = circle_of(p[i], p[j], p[k]);
      }
    }
  }
  return circle;
}

void draw_bounding_circle(const MutableI420View& image, std::span<const Eigen::Vector2d> pixels,
                          Rgb color, float line_px, double margin_px) {
  const auto circle = enclosing_circle(pixels);
  if (!circle) return;
  const float radius = static_cast<float>(circle->radius + margin_px);
  const marks::LineStyle line_style{to_yuv(color), to_yuv(color), line_px, false};
  marks::draw_circle(draw::canvas_of(image), {to_point(circle->center), radius}, line_style);
}

void draw_bounding_rectangle(const MutableI420View& image, std::span<const Eigen::Vector2d> pixels,
                             Rgb color, float line_px, double margin_px) {
  if (pixels.empty()) return;
  const Box box = box_around(pixels);
  const Eigen::Vector2d margin(margin_px, margin_px);
  const marks::LineStyle line_style{to_yuv(color), to_yuv(color), line_px, false};
  marks::draw_box2d(draw::canvas_of(image), to_point(box.low - margin), to_point(box.high + margin),
                    line_style);
}

void marks_of_points(const CameraModel& camera, const Rigid3& camera_from_world,
                     std::span<const ScenePoint> points, std::vector<PointMark>& out) {
  for (const ScenePoint& point : points) {
    const Eigen::Vector3d in_camera = camera_from_world * point.point_in_world;
    const auto pixel = camera.project(in_camera);
    if (pixel && camera.contains(*pixel)) {
      out.push_back({*pixel, in_camera.z(), point.kind, false});
    }
  }
}

}  // namespace sightline
