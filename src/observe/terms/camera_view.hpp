// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "sightline/geometry/camera_model.hpp"

namespace sightline::observe {

/// A camera as a search, fit or matcher sees it: its lens, where it stands, and when its image was
/// taken. What they need of the image itself they add as their own members:
///     struct FitCamera : CameraView { const EdgeImage* edges = nullptr; };
/// The camera must outlive the view.
struct CameraView {
  const CalibratedCamera* camera = nullptr;
  Rigid3 camera_from_world;
  double seconds = 0;  ///< capture after the reference time of the measurement

  CameraView() = default;
  explicit CameraView(const CalibratedCamera& calibrated, double seconds_after_reference = 0)
      : camera(&calibrated),
        camera_from_world(calibrated.world_from_camera.inverse()),
        seconds(seconds_after_reference) {}

  /// Distorted pixel; empty where the lens does not project.
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& point_in_world) const {
    return camera->model.project(camera_from_world * point_in_world);
  }
};

}  // namespace sightline::observe
