// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/stereo/stereo_points.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "observe/stereo/epipolar_match.hpp"
#include "observe/stereo/interest_points.hpp"
#include "sightline/geometry/triangulation.hpp"

namespace sightline {
namespace {

using observe::EpipolarMatch;
using observe::EpipolarMatcher;
using observe::InterestPoint;
using observe::MatchView;
using observe::SmoothPlane;

bool fits(const StereoView& view) {
  return view.camera != nullptr && view.gray.data != nullptr &&
         view.gray.width == view.camera->model.width() &&
         view.gray.height == view.camera->model.height();
}

/// The part of a view's image that shows the region, with room for patches around it.
std::optional<SmoothPlane> cut(const StereoView& view, const StereoRegion& region,
                               const StereoPointOptions& options) {
  const Eigen::Vector3d center = view.camera->world_from_camera.inverse() * region.center;
  if (center.norm() <= region.radius) {
    return SmoothPlane(view.gray, 0, 0, view.gray.width, view.gray.height, options.smoothing_px);
  }
  // Points of a box about the ball: its outline lies within their pixels.
  Eigen::Array2d low(1e9, 1e9), high(-1e9, -1e9);
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d sign(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
    const auto pixel = view.camera->model.project(center + region.radius * sign);
    if (!pixel) continue;
    low = low.min(pixel->array());
    high = high.max(pixel->array());
  }
  if (low.x() > high.x()) return std::nullopt;
  const double margin = 3.0 * options.patch_radius_px + 4;
  low = (low - margin).max(0).min(1e5);
  high = (high + margin).max(0).min(1e5);
  SmoothPlane plane(view.gray, static_cast<int>(low.x()), static_cast<int>(low.y()),
                    static_cast<int>(high.x()), static_cast<int>(high.y()), options.smoothing_px);
  if (plane.x1() <= plane.x0() || plane.y1() <= plane.y0()) return std::nullopt;
  return plane;
}

bool matched_back(const InterestPoint& point, const Eigen::Vector2d& back,
                  const StereoPointOptions& options) {
  const Eigen::Vector2d miss = back - point.pixel;
  if (point.kind == PointKind::kCorner) return miss.norm() <= options.check_px;
  // Along an edge the match may slide.
  return std::abs(miss.dot(point.normal)) <= options.check_px &&
         miss.norm() <= 2 * options.check_px;
}

}  // namespace

void StereoPointFinder::find(const StereoView& first, const StereoView& second,
                             const StereoRegion& region, std::vector<ScenePoint>& out) {
  if (!fits(first) || !fits(second)) return;
  const auto first_plane = cut(first, region, options_),
             second_plane = cut(second, region, options_);
  if (!first_plane || !second_plane) return;
  const MatchView a(*first.camera, *first_plane), b(*second.camera, *second_plane);
  EpipolarMatcher forth(a, b, region, options_), back(b, a, region, options_);
  const double min_across = std::sin(options_.min_edge_angle);
  const auto points = observe::interest_points(
      *first_plane, {options_.max_corners, options_.max_edges, options_.spacing_px,
                     options_.min_gradient, options_.patch_radius_px + 2});
  for (const InterestPoint& point : points) {
    const bool corner = point.kind == PointKind::kCorner;
    if (!corner && std::abs(forth.epipolar_direction(point.pixel).dot(point.normal)) < min_across) {
      continue;
    }
    ++(corner ? counters_.corners : counters_.edges);
    const auto match = forth.match(point.pixel, true);
    if (!match || match->score < options_.min_score) {
      ++counters_.unmatched;
      continue;
    }
    if (match->score - match->runner_up < options_.min_margin) {
      ++counters_.ambiguous;
      continue;
    }
    const auto returned = back.match(match->pixel, true);
    if (!returned || !matched_back(point, returned->pixel, options_)) {
      ++counters_.unchecked;
      continue;
    }
    const double floor = std::hypot(options_.min_sigma_px, 0.25 * first.camera->rms_px);
    const PointSight sights[] = {{first.camera, point.pixel, floor},
                                 {second.camera, match->pixel, std::hypot(floor, match->sigma_px)}};
    const auto solved = triangulate(sights);
    if (!solved || (solved->point_in_world - region.center).norm() > region.radius) {
      ++counters_.outside;
      continue;
    }
    out.push_back({solved->point_in_world, solved->covariance, point.kind});
    ++counters_.points;
  }
}

std::vector<std::pair<size_t, size_t>> stereo_pairs(std::span<const CalibratedCamera> cameras,
                                                    const StereoRegion& region,
                                                    const StereoPointOptions& options) {
  const auto sees = [&](const CalibratedCamera& camera) {
    const auto pixel = camera.model.project(camera.world_from_camera.inverse() * region.center);
    return pixel && camera.model.contains(*pixel);
  };
  const auto angle = [&](const CalibratedCamera& a, const CalibratedCamera& b) {
    const Eigen::Vector3d u = region.center - a.world_from_camera.translation;
    const Eigen::Vector3d v = region.center - b.world_from_camera.translation;
    return std::atan2(u.cross(v).norm(), u.dot(v));
  };
  std::vector<std::pair<size_t, size_t>> pairs;
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (!sees(cameras[i])) continue;
    std::optional<size_t> nearest;
    double min = options.max_angle;
    for (size_t k = 0; k < cameras.size(); ++k) {
      if (k == i || !sees(cameras[k])) continue;
      const double between = angle(cameras[i], cameras[k]);
      if (between < options.min_angle || between > min) continue;
      if (nearest && between == min) continue;
      min = between;
      nearest = k;
    }
    if (nearest) pairs.emplace_back(std::min(i, *nearest), std::max(i, *nearest));
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

CalibratedCamera moved_with(const CalibratedCamera& camera, const Rigid3& seen,
                            const Rigid3& reference) {
  CalibratedCamera moved = camera;
  moved.world_from_camera = reference * seen.inverse() * camera.world_from_camera;
  return moved;
}

}  // namespace sightline
