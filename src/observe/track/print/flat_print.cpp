// SPDX-License-Identifier: Apache-2.0
#include "observe/track/print/flat_print.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace sightline::observe {
namespace {

// Of the object's diameter: points that are in one plane, and those that are not.
constexpr double kOnPlane = 0.015, kOffPlane = 0.03;
constexpr size_t kSampled = 10;      // points that planes are laid through
constexpr ptrdiff_t kFewestOff = 4;  // of 764 looks at pictures none had one (docs/tracking.md)
// Of the object's size as the camera sees it.
constexpr double kMoved = 0.25;
constexpr double kElsewhere = 0.6;  // from one look to the next
constexpr Duration kLooks = std::chrono::milliseconds(250);

struct Plane {
  Eigen::Vector3d point, normal;
  double distance(const Eigen::Vector3d& p) const { return std::abs(normal.dot(p - point)); }
};

// Of planes through three of the points that on which most lie (random sample consensus, Fischler
// and Bolles, 1981, with samples that are always the same); none where all are on a line.
std::optional<Plane> common_plane(std::span<const TexturePoints::Found> points, double tolerance) {
  const size_t stride = std::max<size_t>(1, points.size() / kSampled);
  const auto at = [&](size_t i) -> const Eigen::Vector3d& { return points[i].point_in_object; };
  std::optional<Plane> best;
  ptrdiff_t most = 0;
  for (size_t i = 0; i < points.size(); i += stride) {
    for (size_t j = i + stride; j < points.size(); j += stride) {
      for (size_t k = j + stride; k < points.size(); k += stride) {
        const Eigen::Vector3d normal = (at(j) - at(i)).cross(at(k) - at(i));
        if (normal.norm() < tolerance * tolerance) continue;
        const Plane plane{at(i), normal.normalized()};
        const auto on = std::count_if(points.begin(), points.end(), [&](const auto& point) {
          return plane.distance(point.point_in_object) <= tolerance;
        });
        if (on == std::ssize(points)) return plane;
        if (on > most) {
          most = on;
          best = plane;
        }
      }
    }
  }
  return best;
}

Eigen::Vector3d middle_of(std::span<const TexturePoints::Found> points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& point : points) sum += point.point_in_object;
  return sum / static_cast<double>(points.size());
}

// Largest angle of the directions to a mark [rad], from one pose to another.
double way(const std::array<Eigen::Vector3d, 3>& marks, const Rigid3& camera_from_first,
           const Rigid3& camera_from_second) {
  double farthest = 0;
  for (const Eigen::Vector3d& mark : marks) {
    const Eigen::Vector3d first = camera_from_first * mark, second = camera_from_second * mark;
    farthest = std::max(farthest, std::atan2(first.cross(second).norm(), first.dot(second)));
  }
  return farthest;
}

}  // namespace

bool several_planes(std::span<const TexturePoints::Found> points, double diameter) {
  const std::optional<Plane> plane = common_plane(points, kOnPlane * diameter);
  if (!plane) return false;
  const auto off = std::count_if(points.begin(), points.end(), [&](const auto& point) {
    return plane->distance(point.point_in_object) > kOffPlane * diameter;
  });
  return off >= kFewestOff;
}

PrintSeen FlatPrint::judge(Time capture, const Rigid3& world_from_object,
                           std::span<const TexturePoints::Found> points, double diameter,
                           const Rigid3& camera_from_world) {
  if (points.empty()) return PrintSeen::kNone;
  const Rigid3 now = camera_from_world * world_from_object;
  const auto way_from = [&](const Rigid3& then) {
    return way(seen_->marks, camera_from_world * then, now);
  };
  const double size = diameter / now.translation.norm();  // [rad]
  if (!seen_ || capture - seen_->at > kLooks || way_from(seen_->last) > kElsewhere * size) {
    const Eigen::Vector3d middle = middle_of(points);
    seen_ = Seen{{middle, points.front().point_in_object, points.back().point_in_object},
                 world_from_object};
  }
  seen_->at = capture;
  seen_->last = world_from_object;
  seen_->solid =
      seen_->solid || way_from(seen_->first) > kMoved * size || several_planes(points, diameter);
  return seen_->solid ? PrintSeen::kSolid : PrintSeen::kFlat;
}

}  // namespace sightline::observe
