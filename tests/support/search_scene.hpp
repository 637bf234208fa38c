// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include "sightline/observe/shape/viewpoint_model.hpp"
#include "sightline/observe/terms/detection.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "support/scene_rig.hpp"

namespace sightline::test {

/// A small viewpoint model, quick to make: for tests of searches.
inline std::shared_ptr<const ViewpointModel> views_of(const TriangleMesh& mesh) {
  ViewpointModelOptions options;
  options.subdivisions = 2;
  options.image_px = 240;
  const auto render_mesh = std::make_shared<const RenderMesh>(make_render_mesh(mesh));
  return ViewpointModel::build(mesh, mesh_depth_renderer_factory(render_mesh), options).value();
}

inline Rigid3 turned(double angle, const Eigen::Vector3d& axis, const Eigen::Vector3d& place) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis.normalized())), place};
}

/// Three cameras in a cluttered room; `shape` rests or moves in their middle.
inline SceneRigOptions search_scene(const TriangleMesh& shape, ScenePath path) {
  SceneRigOptions options;
  options.azimuths_deg = {0, 70, 150};
  options.shape = std::make_shared<const RayMesh>(shape);
  options.paint.kind = shape.face_colors.empty() ? Paint::Kind::kPlain : Paint::Kind::kFaces;
  options.path = std::move(path);
  options.duration = std::chrono::milliseconds(300);
  return options;
}

inline std::vector<DetectorCamera> detector_cameras(const SceneRig& rig) {
  std::vector<DetectorCamera> cameras;
  for (size_t i = 0; i < rig.cameras().size(); ++i) {
    cameras.push_back({CameraId(static_cast<uint32_t>(i)), rig.cameras()[i]});
  }
  return cameras;
}

/// Calls add(CameraId, const Frame&) with the first frame of every camera.
template <typename Add>
void add_first_frames(const SceneRig& rig, const Add& add) {
  std::vector<bool> seen(rig.cameras().size());
  for (const SceneShot& shot : rig.shots()) {
    const auto camera = static_cast<size_t>(shot.camera);
    if (seen[camera]) continue;
    seen[camera] = true;
    add(CameraId(static_cast<uint32_t>(camera)), *rig.shoot(shot));
  }
}

}  // namespace sightline::test
