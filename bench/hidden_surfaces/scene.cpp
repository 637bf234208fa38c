// SPDX-License-Identifier: Apache-2.0
#include "hidden_surfaces/scene.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "hidden_surfaces/ray_triangle.hpp"

namespace sightline::hidden_surfaces {
namespace {

Eigen::Isometry3d placed(double x, double y, double z, double turn, double tilt) {
  using Eigen::AngleAxisd;
  using Eigen::Vector3d;
  return Eigen::Translation3d(x, y, z) * AngleAxisd(tilt, Vector3d::UnitX()) *
         AngleAxisd(turn, Vector3d::UnitY());
}

void add(Scene& scene, const TriangleMesh& mesh, const Eigen::Isometry3d& camera_from_mesh,
         int owner) {
  for (const auto& corners : mesh.faces) {
    Face face;
    face.owner = owner;
    for (size_t i = 0; i < 3; ++i) {
      face.corner[i] = camera_from_mesh * mesh.vertices[corners[i]].cast<double>();
    }
    scene.faces.push_back(face);
  }
}

Scene make_barn_scene(const std::string& meshes) {
  Scene scene{"barn", {}, {}};
  const TriangleMesh barn = read_mesh(meshes + "/barn.3vn").value();
  add(scene, barn, placed(0, 0, 5, 0.6, 2.4) * Eigen::Translation3d(-barn.center.cast<double>()),
      0);
  add(scene, make_box({0.25f, 2.4f, 0.25f}), placed(0.35, 0, 3.6, 0.3, 0.1), 1);  // a post
  return scene;
}

}  // namespace

Eigen::Vector2d View::project(const Eigen::Vector3d& point) const {
  return focal_px * point.head<2>() / point.z() + Eigen::Vector2d(width / 2, height / 2);
}

Eigen::Vector3d View::ray(double x, double y) const {
  return {(x - width / 2) / focal_px, (y - height / 2) / focal_px, 1};
}

Plane Face::plane() const {
  Plane plane;
  plane.normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
  plane.offset = plane.normal.dot(corner[0]);
  return plane;
}

Tile Scene::tile() const {
  Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);
  for (const Face& face : faces) {
    for (const Eigen::Vector3d& corner : face.corner) {
      const Eigen::Vector2d pixel = view.project(corner);
      low = low.cwiseMin(pixel);
      high = high.cwiseMax(pixel);
    }
  }
  Tile tile;
  tile.x = std::max(0, static_cast<int>(std::floor(low.x())));
  tile.y = std::max(0, static_cast<int>(std::floor(low.y())));
  tile.width = std::min(view.width, static_cast<int>(std::ceil(high.x())) + 1) - tile.x;
  tile.height = std::min(view.height, static_cast<int>(std::ceil(high.y())) + 1) - tile.y;
  return tile;
}

Picture::Picture(const Tile& where)
    : tile(where), face(static_cast<size_t>(where.width) * static_cast<size_t>(where.height), -1) {}

Scene make_torus_scene(const std::string& name, size_t faces, double width_px) {
  constexpr double kRadius = 0.15;
  Scene scene{name, {}, {}};
  const double z = 2 * kRadius * scene.view.focal_px / width_px;
  add(scene, make_bumpy_torus(faces, static_cast<float>(kRadius)), placed(0, 0, z, 0.3, 0.5), 0);
  // Long faces through the hole: in front of one side, behind the other.
  add(scene, make_box({0.04f, 0.04f, 0.6f}), placed(0, 0, z, 0.5, 0.3), 1);
  return scene;
}

Scene make_pierced_scene() {
  Scene scene{"pierced", {}, {}};
  add(scene, make_box({0.3f, 0.2f, 0.2f}), placed(0, 0, 1, 0.5, 0.4), 0);
  add(scene, make_box({0.1f, 0.5f, 0.1f}), placed(0.02, 0, 0.97, 0.2, 0.7), 1);
  return scene;
}

Scene make_scene(const std::string& name, const std::string& meshes) {
  if (name == "barn") return make_barn_scene(meshes);
  if (name == "pierced") return make_pierced_scene();
  return make_torus_scene(name, name == "torus" ? 1000 : name == "10k" ? 10'000 : 100'000, 256);
}

int32_t nearest_face(const Scene& scene, int x, int y) {
  const Eigen::Vector3d ray = scene.view.ray(x, y);
  int32_t nearest = -1;
  double distance = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < scene.faces.size(); ++i) {
    if (!scene.faces[i].seen_from_front()) continue;
    const auto hit = hit_distance(scene.faces[i], ray);
    if (!hit || *hit >= distance) continue;
    distance = *hit;
    nearest = static_cast<int32_t>(i);
  }
  return nearest;
}

}  // namespace sightline::hidden_surfaces
