// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace sightline {

/// An upright box: all points between two corners, in one frame [m].
struct Box3 {
  Eigen::Vector3d min = Eigen::Vector3d::Zero();
  Eigen::Vector3d max = Eigen::Vector3d::Zero();

  bool contains(const Eigen::Vector3d& point) const {
    return (point.array() >= min.array()).all() && (point.array() <= max.array()).all();
  }
  /// To the nearest point of the box; 0 inside.
  double distance(const Eigen::Vector3d& point) const {
    return (point - point.cwiseMax(min).cwiseMin(max)).norm();
  }
  /// To the corner that is furthest away.
  double farthest(const Eigen::Vector3d& point) const {
    return (point - min).cwiseAbs().cwiseMax((point - max).cwiseAbs()).norm();
  }
  /// The point at shares 0..1 of its sides.
  Eigen::Vector3d at(double x, double y, double z) const {
    return min + (max - min).cwiseProduct(Eigen::Vector3d(x, y, z));
  }

  bool operator==(const Box3& other) const { return min == other.min && max == other.max; }
};

}  // namespace sightline
