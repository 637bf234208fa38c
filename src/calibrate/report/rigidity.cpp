// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <map>

#include "calibrate/solve/corner_at_set.hpp"
#include "sightline/calibrate/assess.hpp"
#include "sightline/geometry/triangulation.hpp"

namespace sightline {

using namespace calibrate;

namespace {

struct LengthSums {
  double squares = 0, adjacent_squares = 0, scale = 0;
  size_t count = 0, adjacent = 0;
};

void add_set(const CalibrationTarget& target, const std::map<int, Eigen::Vector3d>& points,
             LengthSums& sums) {
  const CalibrationTarget& part = target.part(points.begin()->first);
  const double near = 1.01 * (part.kind == TargetKind::kTagGrid ? part.marker : part.square);
  for (auto a = points.begin(); a != points.end(); ++a) {
    for (auto b = std::next(a); b != points.end(); ++b) {
      const double printed = (target.corner(a->first) - target.corner(b->first)).norm();
      const double measured = (a->second - b->second).norm();
      const double error = measured - printed;
      sums.squares += error * error;
      sums.scale += measured / printed;
      ++sums.count;
      if (printed > near) continue;
      sums.adjacent_squares += error * error;
      ++sums.adjacent;
    }
  }
}

}  // namespace

std::optional<RigidityReport> rigidity(const CalibrationViews& views,
                                       const std::vector<CalibratedCamera>& cameras) {
  std::vector<std::vector<const TargetView*>> by_set(views.sets);
  for (const TargetView& view : views.views) by_set[view.set].push_back(&view);
  LengthSums sums;
  for (const auto& set : by_set) {
    if (set.size() < 2) continue;
    std::map<int, std::vector<PointSight>> sights;
    for (const TargetView* view : set) {
      const CalibratedCamera& camera = cameras[view->camera];
      for (const TargetCorner& corner : view->corners) {
        sights[corner.id].push_back({&camera, pixel_at_set(*view, corner, camera), 0.5});
      }
    }
    std::map<int, Eigen::Vector3d> points;
    for (const auto& [id, rays] : sights) {
      if (rays.size() < 2) continue;
      const auto point = triangulate(rays);
      if (point) points[id] = point->point_in_world;
    }
    if (points.empty()) continue;
    add_set(views.target, points, sums);
  }
  if (sums.count == 0) return std::nullopt;
  const auto n = static_cast<double>(sums.count);
  const auto near = static_cast<double>(std::max<size_t>(1, sums.adjacent));
  return RigidityReport{1e3 * std::sqrt(sums.squares / n),
                        1e3 * std::sqrt(sums.adjacent_squares / near), sums.scale / n, sums.count};
}

}  // namespace sightline
