// SPDX-License-Identifier: Apache-2.0
#include "point_picture.hpp"

namespace sightline {

void marks_of_points(const CalibratedCamera& camera, std::span<const ScenePoint> points,
                     std::vector<PointMark>& out) {
  const Rigid3 camera_from_world = camera.world_from_camera.inverse();
  for (const ScenePoint& point : points) {
    const Eigen::Vector3d in_camera = camera_from_world * point.point_in_world;
    const auto pixel = camera.model.project(in_camera);
    if (pixel && camera.model.contains(*pixel)) {
      out.push_back({*pixel, in_camera.z(), point.kind, false});
    }
  }
}

}  // namespace sightline
