// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <memory>

#include "mesh_depth_renderer.hpp"
#include "sightline/observe/viewpoint_model.hpp"

namespace sightline::test {

/// A small viewpoint model, quick to make: for tests of searches.
inline std::shared_ptr<const ViewpointModel> views_of(const TriangleMesh& mesh) {
  ViewpointModelOptions options;
  options.subdivisions = 2;
  options.picture_px = 240;
  const auto render_mesh = std::make_shared<const RenderMesh>(make_render_mesh(mesh));
  return ViewpointModel::build(mesh, mesh_depth_renderer_factory(render_mesh), options).value();
}

inline Rigid3 turned(double angle, const Eigen::Vector3d& axis, const Eigen::Vector3d& place) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis.normalized())), place};
}

}  // namespace sightline::test
