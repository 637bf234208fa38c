// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "sightline/base/time.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline {

/// What a reconstructed point is of; drawn apart.
enum class PointKind : uint8_t { kPoint, kEdge, kCorner };

/// "point", "edge", "corner", as in files.
constexpr std::string_view to_string(PointKind kind) {
  return kind == PointKind::kEdge ? "edge" : kind == PointKind::kCorner ? "corner" : "point";
}

/// A point that cameras reconstructed.
struct ScenePoint {
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();  ///< [m]
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();      ///< world frame [m^2]
  PointKind kind = PointKind::kPoint;
};

/// The points of one time. Immutable once handed over; any thread.
struct ScenePoints {
  Time time{};            ///< capture time of the frames they come from
  CameraSet cameras = 0;  ///< that saw them
  std::vector<ScenePoint> points;
};
using ScenePointsPtr = std::shared_ptr<const ScenePoints>;

}  // namespace sightline
