// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include "sightline/observe/shape/surface_sample.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"
#include "sightline/observe/terms/detection.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "support/random.hpp"
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

/// A hundred places of each face, in the face's color as an image shows it.
inline std::vector<SurfaceSample> samples_of(const TriangleMesh& mesh) {
  std::vector<SurfaceSample> samples;
  Random random(3);
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    const Eigen::Vector3f& p = mesh.vertices[mesh.faces[f][0]];
    const Eigen::Vector3f u = mesh.vertices[mesh.faces[f][1]] - p;
    const Eigen::Vector3f v = mesh.vertices[mesh.faces[f][2]] - p;
    const Eigen::Vector3f rgb = mesh.face_colors[f].array().pow(1 / 2.2f);
    const float luma = 0.299f * rgb.x() + 0.587f * rgb.y() + 0.114f * rgb.z();
    const Eigen::Vector3f yuv(16 + 219 * luma, 128 + 126 * (rgb.z() - luma),
                              128 + 160 * (rgb.x() - luma));
    for (int i = 0; i < 100; ++i) {
      float a = static_cast<float>(random.uniform()), b = static_cast<float>(random.uniform());
      if (a + b > 1) a = 1 - a, b = 1 - b;
      samples.push_back({p + a * u + b * v, u.cross(v).normalized(), yuv});
    }
  }
  return samples;
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
