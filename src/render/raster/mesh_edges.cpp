// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "sightline/render/raster/raster.hpp"

namespace sightline {
namespace {

/// A piece may leave the true curve by this much [px].
constexpr double kCurveError = 0.05;
/// Distance of the points at which depth is looked up [px].
constexpr double kSampleStep = 1.5;
/// Lines are followed this far outside the image, so that thick strokes end out of sight [px].
constexpr double kOutside = 16.0;

/// Part of a straight line in ray space; 1/z is linear along it.
struct RayLine {
  Eigen::Vector2d start, end;
  double inverse_start = 0, inverse_end = 0;

  Eigen::Vector2d at(double s) const { return start + s * (end - start); }
  double inverse_at(double s) const { return inverse_start + s * (inverse_end - inverse_start); }
};

/// The line in front of the near plane.
std::optional<RayLine> cut_near(Eigen::Vector3d a, Eigen::Vector3d b) {
  if (a.z() < kNearPlane && b.z() < kNearPlane) return std::nullopt;
  const auto cut = [](const Eigen::Vector3d& p, const Eigen::Vector3d& q) {
    Eigen::Vector3d m = p + (kNearPlane - p.z()) / (q.z() - p.z()) * (q - p);
    m.z() = kNearPlane;
    return m;
  };
  if (a.z() < kNearPlane) a = cut(a, b);
  if (b.z() < kNearPlane) b = cut(b, a);
  return RayLine{a.head<2>() / a.z(), b.head<2>() / b.z(), 1 / a.z(), 1 / b.z()};
}

/// Parameters s0..s1 of the line inside the disc where the lens projects.
bool cut_disc(const RayLine& line, double radius, double& s0, double& s1) {
  const Eigen::Vector2d d = line.end - line.start;
  const double a = d.squaredNorm();
  const double b = line.start.dot(d);
  const double c = line.start.squaredNorm() - radius * radius;
  if (a <= 0) return c <= 0;
  const double root = b * b - a * c;
  if (!(root >= 0)) return false;
  const double width = std::sqrt(root);
  s0 = std::max(s0, (-b - width) / a);
  s1 = std::min(s1, (-b + width) / a);
  return s0 <= s1;
}

/// The same for the rectangle of rays under the image, grown a little.
bool cut_frame(const RayLine& line, const RayTable& rays, double& s0, double& s1) {
  const RayTable::RayBounds& b = rays.frame_bounds();
  const double grow_x = kOutside * 2 * (double{b.max_x} - double{b.min_x}) / rays.width();
  const double grow_y = kOutside * 2 * (double{b.max_y} - double{b.min_y}) / rays.height();
  const Eigen::Vector2d d = line.end - line.start;
  const auto slab = [&](double p, double slope, double low, double high) {
    if (slope == 0) return p >= low && p <= high;
    const double t0 = (low - p) / slope;
    const double t1 = (high - p) / slope;
    s0 = std::max(s0, std::min(t0, t1));
    s1 = std::min(s1, std::max(t0, t1));
    return s0 <= s1;
  };
  return slab(line.start.x(), d.x(), double{b.min_x} - grow_x, double{b.max_x} + grow_x) &&
         slab(line.start.y(), d.y(), double{b.min_y} - grow_y, double{b.max_y} + grow_y);
}

/// A line on its way through the lens, and where its pieces go.
struct Trace {
  const RayTable& rays;
  uint32_t name;
  std::vector<EdgeSegment>& out;
  Eigen::Vector2d start;  ///< of the piece under way [px]
  bool hidden = false;    ///< and what it is

  bool near_image(const Eigen::Vector2d& p) const {
    return p.x() > -kOutside && p.y() > -kOutside && p.x() < rays.width() + kOutside &&
           p.y() < rays.height() + kOutside;
  }
  void end_piece(const Eigen::Vector2d& p) {
    if (near_image(start) || near_image(p)) {
      out.push_back({static_cast<float>(start.x()), static_cast<float>(start.y()),
                     static_cast<float>(p.x()), static_cast<float>(p.y()), name, !hidden});
    }
    start = p;
  }
};

/// Follows one line through the lens. `hidden(inverse_z, pixel)` is asked every kSampleStep, or
/// once a piece if the answer is the same all along the line. Only the ends of pieces are
/// projected: what keeps a piece straight within kCurveError keeps the samples along it as true.
template <typename Hidden>
void trace(const RayTable& rays, const Eigen::Vector3d& a, const Eigen::Vector3d& b, uint32_t name,
           bool same_all_along, const Hidden& hidden, std::vector<EdgeSegment>& out) {
  if (rays.frame_bounds().empty()) return;
  const auto line = cut_near(a, b);
  double s0 = 0, s1 = 1;
  if (!line || !cut_disc(*line, rays.project_limit() * (1 - 1e-9), s0, s1) ||
      !cut_frame(*line, rays, s0, s1))
    return;
  const double length = (s1 - s0) * (line->end - line->start).norm();
  // Ray length of one piece, from the bound of the lens's curvature.
  const double bend = rays.curvature_bound(0, std::max(line->at(s0).norm(), line->at(s1).norm()));
  const double straight = bend > 0 ? std::sqrt(8 * kCurveError / bend) : length;
  const int pieces =
      length > 0 ? static_cast<int>(std::clamp(std::ceil(length / straight), 1.0, 8192.0)) : 1;
  const auto first = rays.project(line->at(s0));
  if (!first) return;
  Trace path{rays, name, out, *first};
  Eigen::Vector2d from = *first;
  for (int i = 0; i < pieces; ++i) {
    const double begin = s0 + (s1 - s0) * i / pieces;
    const double end = s0 + (s1 - s0) * (i + 1) / pieces;
    const auto to = rays.project(line->at(end));
    if (!to) return;
    const Eigen::Vector2d delta = *to - from;
    const double wanted = same_all_along ? 1 : std::ceil(delta.norm() / kSampleStep);
    const int samples = static_cast<int>(std::clamp(wanted, 1.0, 8192.0));
    // Samples sit in the middle of their stretch; a piece ends where the answer changes.
    for (int k = 0; k < samples; ++k) {
      const double share = (k + 0.5) / samples;
      const bool is_hidden =
          hidden(line->inverse_at(begin + share * (end - begin)), from + share * delta);
      if (k > 0 && is_hidden != path.hidden) path.end_piece(from + delta * k / samples);
      path.hidden = is_hidden;
    }
    path.end_piece(*to);
    from = *to;
  }
}

/// Inverse depth in the tile at the pixel nearest to `pixel`; nothing outside the tile.
std::optional<double> depth_at(const RasterTile& tile, const Eigen::Vector2d& pixel, int& px,
                               int& py) {
  px = static_cast<int>(std::floor(pixel.x() + 0.5));
  py = static_cast<int>(std::floor(pixel.y() + 0.5));
  if (!tile.rect().contains(px, py)) return std::nullopt;
  return tile.inverse_depth(py - tile.rect().y)[px - tile.rect().x];
}

/// 1/z of a face's plane as a function of the ray: slope . (rx, ry, 1). Zero for a plane through
/// the camera.
Eigen::Vector3d plane_slope(const RenderMesh& mesh, const Eigen::Matrix3d& rotation,
                            const Eigen::Vector3d& point_in_camera, uint32_t face) {
  const Eigen::Vector3d normal = rotation * mesh.normal(face);
  const double distance = normal.dot(point_in_camera);
  if (std::abs(distance) < 1e-12) return Eigen::Vector3d::Zero();
  return normal / distance;
}

}  // namespace

void project_line(const RayTable& rays, const Eigen::Vector3d& start_in_camera,
                  const Eigen::Vector3d& end_in_camera, uint32_t line, const RasterTile* depth,
                  double tolerance, std::vector<EdgeSegment>& out) {
  const auto hidden = [&](double inverse_z, const Eigen::Vector2d& pixel) {
    if (depth == nullptr) return false;
    int px = 0, py = 0;
    const auto stored = depth_at(*depth, pixel, px, py);
    return stored && *stored > inverse_z * (1 + tolerance);
  };
  trace(rays, start_in_camera, end_in_camera, line, depth == nullptr, hidden, out);
}

void visible_edges(const RayTable& rays, const RenderMesh& mesh, const Rigid3& camera_from_object,
                   const RasterTile& depth, std::vector<EdgeSegment>& out) {
  const Eigen::Matrix3d rotation = camera_from_object.rotation_matrix();
  const Eigen::Vector3d& translation = camera_from_object.translation;
  const Eigen::Vector3d eye = -(rotation.transpose() * translation);
  const double slack = 0.003 * double{mesh.radius};
  for (uint32_t i = 0; i < mesh.feature_edges.size(); ++i) {
    const FeatureEdge& edge = mesh.feature_edges[i];
    const Eigen::Vector3d start = mesh.vertex(edge.start);
    const Eigen::Vector3d a = rotation * start + translation;
    const Eigen::Vector3d b = rotation * mesh.vertex(edge.end) + translation;
    const auto turned = [&](uint32_t f) { return mesh.normal(f).dot(eye - start) <= 0; };
    const bool behind = mesh.cull_back_faces && turned(edge.first_face) && turned(edge.second_face);
    const Eigen::Vector3d first = plane_slope(mesh, rotation, a, edge.first_face);
    const Eigen::Vector3d second = plane_slope(mesh, rotation, a, edge.second_face);
    // The stored depth belongs to the pixel's center: it is compared with where the edge's own
    // faces pass there, not with the edge, so steep faces do not hide their own edges.
    const auto hidden = [&](double inverse_z, const Eigen::Vector2d& pixel) {
      if (behind) return true;
      int px = 0, py = 0;
      const auto stored = depth_at(depth, pixel, px, py);
      if (!stored || px >= rays.width() || py >= rays.height()) return false;
      const Eigen::Vector3d center(double{rays.x_row(py)[px]}, double{rays.y_row(py)[px]}, 1);
      const double own = std::max({inverse_z, first.dot(center), second.dot(center)});
      return *stored > own * (1 + slack * own);
    };
    trace(rays, a, b, i, behind, hidden, out);
  }
}

}  // namespace sightline
