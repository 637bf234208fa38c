// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/pixels/sample_edges.hpp"

#include <algorithm>
#include <cmath>

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {
namespace {

// Strength of the edge along `normal` at a place; 0 outside and where it is below the threshold.
double edge_along(const EdgeImage& edges, const Eigen::Vector2d& place,
                  const Eigen::Vector2d& normal) {
  // No floor(): what it would round otherwise is out of the image in any case.
  const int x = static_cast<int>(place.x() + 0.5), y = static_cast<int>(place.y() + 0.5);
  if (x < 1 || y < 1 || x >= edges.width() - 1 || y >= edges.height() - 1) return 0;
  const size_t i =
      static_cast<size_t>(y) * static_cast<size_t>(edges.width()) + static_cast<size_t>(x);
  const auto strength = static_cast<double>(edges.magnitude()[i]);
  if (strength < static_cast<double>(edges.threshold())) return 0;
  const double along = std::abs(static_cast<double>(edges.gradient_x()[i]) * normal.x() +
                                static_cast<double>(edges.gradient_y()[i]) * normal.y());
  return along > 0.8 * strength ? along : 0;
}

}  // namespace

std::optional<ProjectedSample> project_sample(const CameraModel& camera,
                                              const Rigid3& camera_from_object,
                                              const Eigen::Vector3d& point,
                                              const Eigen::Vector3d& normal, double step) {
  ProjectedSample out;
  const auto pixel = camera.project(camera_from_object * point, &out.jacobian);
  const auto beside = camera.project(camera_from_object * (point + step * normal));
  if (!pixel || !beside) return std::nullopt;
  out.normal = *beside - *pixel;
  const double length = out.normal.norm();
  if (!(length > 1e-9)) return std::nullopt;
  out.normal /= length;
  out.pixel = (*pixel + Eigen::Vector2d::Constant(0.5)) / 2 - Eigen::Vector2d::Constant(0.5);
  out.jacobian /= 2;
  return out;
}

std::optional<double> best_edge(const EdgeImage& edges, const ProjectedSample& sample,
                                double reach) {
  const double enough = 4 * static_cast<double>(edges.threshold());
  double best = 0, place = 0;
  const int steps = static_cast<int>(reach);
  for (int s = -steps; s <= steps; ++s) {
    const double strength = edge_along(edges, sample.pixel + s * sample.normal, sample.normal);
    if (!(strength > 0)) continue;
    const double value = std::min(strength, enough) * (1 - 0.7 * std::pow(s / (reach + 1), 2));
    if (value > best) {
      best = value;
      place = s;
    }
  }
  if (!(best > 0)) return std::nullopt;
  const double middle = edge_along(edges, sample.pixel + place * sample.normal, sample.normal);
  const double before =
      edge_along(edges, sample.pixel + (place - 1) * sample.normal, sample.normal);
  const double after = edge_along(edges, sample.pixel + (place + 1) * sample.normal, sample.normal);
  const double bend = before + after - 2 * middle;
  if (bend < -1e-6) place += std::clamp(0.5 * (before - after) / bend, -0.7, 0.7);
  return place;
}

bool weak_edge(const EdgeImage& edges, const Eigen::Vector2d& place,
               const Eigen::Vector2d& normal) {
  for (const int s : {0, -1, 1}) {
    const int x = static_cast<int>(std::floor(place.x() + s * normal.x() + 0.5));
    const int y = static_cast<int>(std::floor(place.y() + s * normal.y() + 0.5));
    if (x < 1 || y < 1 || x >= edges.width() - 1 || y >= edges.height() - 1) continue;
    const size_t i =
        static_cast<size_t>(y) * static_cast<size_t>(edges.width()) + static_cast<size_t>(x);
    const auto gx = static_cast<double>(edges.gradient_x()[i]),
               gy = static_cast<double>(edges.gradient_y()[i]);
    const double along = std::abs(gx * normal.x() + gy * normal.y());
    if (along > kWeakEdgeShare * static_cast<double>(edges.threshold()) &&
        along > 0.8 * std::hypot(gx, gy))
      return true;
  }
  return false;
}

std::optional<double> foreground_border(const ForegroundMap& map, const ProjectedSample& sample,
                                        double reach) {
  const auto at = [&](int s) {
    const Eigen::Vector2d place = sample.pixel + s * sample.normal;
    const int x = static_cast<int>(std::floor(place.x() + 0.5));
    const int y = static_cast<int>(std::floor(place.y() + 0.5));
    if (x < 0 || y < 0 || x >= map.width || y >= map.height)
      return uint8_t{ForegroundMap::kUnknown};
    return map.row(y)[x];
  };
  const int steps = static_cast<int>(reach);
  for (int k = 0; k <= 2 * steps; ++k) {
    const int s = k % 2 == 0 ? k / 2 : -(k + 1) / 2;
    const uint8_t inner = at(s), outer = at(s + 1);
    const bool is_new = inner == ForegroundMap::kForeground || inner == ForegroundMap::kShadow;
    if (is_new && outer == ForegroundMap::kBackground) return s + 0.5;
  }
  return std::nullopt;
}

}  // namespace sightline::observe
