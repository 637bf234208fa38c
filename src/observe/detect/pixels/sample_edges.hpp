// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <optional>

#include "observe/detect/pixels/edge_maps.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/observe/terms/foreground_map.hpp"

namespace sightline::observe {

/// A sample of an outline or a crease in the half-size image.
struct ProjectedSample {
  Eigen::Vector2d pixel, normal;         ///< unit normal
  Eigen::Matrix<double, 2, 3> jacobian;  ///< half-size pixel by point in camera
};

/// `normal` in the object frame. Empty if the point does not project, or the normal to a point.
std::optional<ProjectedSample> project_sample(const CameraModel& camera,
                                              const Eigen::Isometry3d& camera_from_object,
                                              const Eigen::Vector3d& point,
                                              const Eigen::Vector3d& normal);

/// Distance along the normal [half-size px] to the best edge that crosses it, at most `reach`:
/// strong ones and near ones are preferred.
std::optional<double> best_edge(const EdgeImage& edges, const ProjectedSample& sample,
                                double reach);
/// The image changes across the normal, however weakly, within a pixel of a place.
bool weak_edge(const EdgeImage& edges, const Eigen::Vector2d& place, const Eigen::Vector2d& normal);
/// Distance along the normal to the nearest place where the foreground ends.
std::optional<double> foreground_border(const ForegroundMap& map, const ProjectedSample& sample,
                                        double reach);

}  // namespace sightline::observe
