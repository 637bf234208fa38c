// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/marks.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline::marks {
namespace {

constexpr Yuv kDark{16, 128, 128};
constexpr float kXrayOpacity = 0.7f;

draw::Stroke pen_of(const LineStyle& line_style, bool behind_scene) {
  return {behind_scene ? line_style.xray_color : line_style.color, line_style.line_px,
          behind_scene ? kXrayOpacity : 1.0f, false};
}

}  // namespace

draw::Stroke halo_of(const draw::Stroke& stroke, float opacity) {
  // Darker is enough: leaving chroma alone keeps the color of the line beside it.
  return {kDark, stroke.width + 2, opacity * stroke.opacity, true};
}

std::optional<Circle> sphere_circle(const CameraModel& model,
                                    const Eigen::Vector3d& center_in_camera, double radius) {
  const auto center = model.project(center_in_camera);
  const double distance = center_in_camera.norm();
  if (!center || distance <= radius) return std::nullopt;
  // Rays touch the sphere on a circle of radius r * sqrt(1 - r^2/d^2), r^2/d before its center.
  const double ratio = radius / distance;
  const Eigen::Vector3d middle = center_in_camera * (1 - ratio * ratio);
  const double reach = radius * std::sqrt(1 - ratio * ratio);
  const Eigen::Vector3d side = center_in_camera.unitOrthogonal();
  const Eigen::Vector3d up = center_in_camera.cross(side).normalized();
  constexpr int kSamples = 16;
  double farthest = 0;
  for (int i = 0; i < kSamples; ++i) {
    const double angle = 2 * std::numbers::pi * i / kSamples;
    const auto pixel =
        model.project(middle + reach * (std::cos(angle) * side + std::sin(angle) * up));
    if (pixel) farthest = std::max(farthest, (*pixel - *center).norm());
  }
  return Circle{center->cast<float>(), static_cast<float>(farthest)};
}

void add_line(const RayTable& rays, const RasterTile* occluders, float factor,
              const Eigen::Vector3d& start_in_camera, const Eigen::Vector3d& end_in_camera,
              uint32_t line, uint8_t flags, Pieces& out) {
  project_line(rays, start_in_camera, end_in_camera, line, occluders, factor - 1, out.segments);
  for (size_t i = out.flags.size(); i < out.segments.size(); ++i) {
    const uint8_t hidden = out.segments[i].visible ? uint8_t{0} : uint8_t{kBehindScene};
    out.flags.push_back(static_cast<uint8_t>(flags | hidden));
  }
}

void add_box(const RayTable& rays, const RasterTile* occluders, float factor,
             const Rigid3& camera_from_object, const Eigen::Vector3d& low,
             const Eigen::Vector3d& high, Pieces& out) {
  const Eigen::Vector3d eye = camera_from_object.inverse().translation;
  const bool inside = (eye.array() > low.array()).all() && (eye.array() < high.array()).all();
  const auto faces_us = [&](int axis, bool is_high) {
    return is_high ? eye[axis] > high[axis] : eye[axis] < low[axis];
  };
  for (int axis = 0; axis < 3; ++axis) {
    const int second = (axis + 1) % 3;
    const int third = (axis + 2) % 3;
    for (int corner = 0; corner < 4; ++corner) {
      const bool second_high = (corner & 1) != 0;
      const bool third_high = (corner & 2) != 0;
      Eigen::Vector3d start;
      start[axis] = low[axis];
      start[second] = second_high ? high[second] : low[second];
      start[third] = third_high ? high[third] : low[third];
      Eigen::Vector3d end = start;
      end[axis] = high[axis];
      const bool near = inside || faces_us(second, second_high) || faces_us(third, third_high);
      add_line(rays, occluders, factor, camera_from_object * start, camera_from_object * end,
               static_cast<uint32_t>(4 * axis + corner), near ? uint8_t{0} : uint8_t{kTurnedAway},
               out);
    }
  }
}

void draw_pieces(const draw::Canvas& canvas, const Pieces& pieces, const LineStyle& line_style,
                 bool halo, Points& points) {
  const std::vector<EdgeSegment>& segments = pieces.segments;
  for (size_t i = 0; i < segments.size();) {
    const EdgeSegment& first = segments[i];
    const uint8_t flags = pieces.flags[i];
    points.clear();
    points.emplace_back(first.x0, first.y0);
    do {
      points.emplace_back(segments[i].x1, segments[i].y1);
      ++i;
    } while (i < segments.size() && segments[i].line == first.line && pieces.flags[i] == flags &&
             segments[i].x0 == points.back().x() && segments[i].y0 == points.back().y());
    draw::Stroke stroke = pen_of(line_style, (flags & kBehindScene) != 0);
    if ((flags & kTurnedAway) != 0) stroke.opacity *= 0.75f;
    const draw::Dash dash = line_style.dashed || flags != 0 ? LineStyle::kDash : draw::Dash{};
    draw::polyline(canvas, points, halo ? halo_of(stroke, line_style.halo) : stroke, dash);
  }
}

void draw_with_halo(const draw::Canvas& canvas, const Pieces& pieces, const LineStyle& line_style,
                    Points& points) {
  for (const bool halo : {true, false}) draw_pieces(canvas, pieces, line_style, halo, points);
}

void draw_circle(const draw::Canvas& canvas, const Circle& circle, const LineStyle& line_style) {
  const draw::Stroke stroke = pen_of(line_style, false);
  for (const draw::Stroke& each : {halo_of(stroke, line_style.halo), stroke}) {
    if (line_style.dashed) {
      draw::dashed_circle(canvas, circle.center, circle.radius, each, LineStyle::kDash);
    } else {
      draw::circle(canvas, circle.center, circle.radius, each);
    }
  }
}

void draw_box2d(const draw::Canvas& canvas, const draw::Point& low, const draw::Point& high,
                const LineStyle& line_style) {
  const std::array<draw::Point, 5> corners = {low, draw::Point(high.x(), low.y()), high,
                                              draw::Point(low.x(), high.y()), low};
  const draw::Stroke stroke = pen_of(line_style, false);
  draw::polyline(canvas, corners, halo_of(stroke, line_style.halo), line_style.dash());
  draw::polyline(canvas, corners, stroke, line_style.dash());
}

void draw_cross(const draw::Canvas& canvas, const draw::Point& center, float arm_px,
                const LineStyle& line_style) {
  const draw::Stroke stroke = pen_of(line_style, false);
  const std::array<draw::Point, 4> directions = {draw::Point(1, 0), draw::Point(-1, 0),
                                                 draw::Point(0, 1), draw::Point(0, -1)};
  for (const draw::Stroke& each : {halo_of(stroke, line_style.halo), stroke}) {
    for (const draw::Point& direction : directions)
      draw::line(canvas, center + 0.3f * arm_px * direction, center + arm_px * direction, each);
  }
}

std::optional<Eigen::Matrix2d> pixel_covariance(const CameraModel& model,
                                                const Rigid3& camera_from_object,
                                                const Eigen::Matrix<double, 6, 6>& covariance,
                                                const Eigen::Vector3d& point_in_object) {
  Eigen::Matrix<double, 2, 3> projection;
  if (!model.project(camera_from_object * point_in_object, &projection)) return std::nullopt;
  // T * exp(w, v) moves the point by R (w x p + v).
  Eigen::Matrix3d cross;
  const Eigen::Vector3d& p = point_in_object;
  cross << 0, -p.z(), p.y(), p.z(), 0, -p.x(), -p.y(), p.x(), 0;
  Eigen::Matrix<double, 3, 6> motion;
  motion << -cross, Eigen::Matrix3d::Identity();
  const Eigen::Matrix<double, 2, 6> jacobian =
      projection * camera_from_object.rotation_matrix() * motion;
  return Eigen::Matrix2d(jacobian * covariance * jacobian.transpose());
}

void draw_ellipse(const draw::Canvas& canvas, const draw::Point& center,
                  const Eigen::Matrix2d& covariance, double sigmas, const LineStyle& line_style,
                  Points& points) {
  constexpr double kShortest = 1.5;
  constexpr int kPoints = 48;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(covariance);
  const Eigen::Vector2d half =
      (sigmas * solver.eigenvalues().cwiseMax(0).cwiseSqrt()).cwiseMax(kShortest);
  if (!half.allFinite() || half.maxCoeff() > 1e5) return;
  const Eigen::Matrix2d axes = solver.eigenvectors() * half.asDiagonal();
  points.clear();
  for (int i = 0; i <= kPoints; ++i) {
    const double angle = 2 * std::numbers::pi * i / kPoints;
    const Eigen::Vector2d offset = axes * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    points.push_back(center + offset.cast<float>());
  }
  const draw::Stroke stroke = pen_of(line_style, false);
  draw::polyline(canvas, points, halo_of(stroke, line_style.halo), line_style.dash());
  draw::polyline(canvas, points, stroke, line_style.dash());
}

Arrow offscreen_arrow(const CameraModel& model, const Eigen::Vector3d& center_in_camera,
                      float inset_px) {
  const CameraModel::Parameters& lens = model.parameters();
  Eigen::Vector2d direction(lens.fx * center_in_camera.x(), lens.fy * center_in_camera.y());
  if (!(direction.norm() > 1e-9)) direction = Eigen::Vector2d(0, 1);
  const Arrow arrow{{}, direction.normalized().cast<float>()};
  const draw::Point middle(0.5f * static_cast<float>(model.width() - 1),
                           0.5f * static_cast<float>(model.height() - 1));
  const draw::Point reach = (middle.array() - inset_px).cwiseMax(1.0f);
  const float along_x = reach.x() / std::max(std::abs(arrow.direction.x()), 1e-6f);
  const float along_y = reach.y() / std::max(std::abs(arrow.direction.y()), 1e-6f);
  return {middle + std::min(along_x, along_y) * arrow.direction, arrow.direction};
}

void draw_arrow(const draw::Canvas& canvas, const Arrow& arrow, float size_px, Yuv color) {
  const auto head = [&](float grow) {
    const draw::Point side(-arrow.direction.y(), arrow.direction.x());
    const draw::Point tip = arrow.tip + 1.6f * grow * arrow.direction;
    const draw::Point back = arrow.tip - (size_px + grow) * arrow.direction;
    const float half = 0.55f * size_px + 1.4f * grow;
    return std::array<draw::Point, 3>{tip, draw::Point(back + half * side),
                                      draw::Point(back - half * side)};
  };
  draw::polygon(canvas, head(2), kDark, 0.6f);
  draw::polygon(canvas, head(0), color, 1);
}

}  // namespace sightline::marks
