// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <memory>
#include <vector>

#include "render/render_support.hpp"
#include "sightline/geometry/mesh.hpp"
#include "sightline/image/image.hpp"
#include "sightline/render/mesh/mesh_paint.hpp"

namespace sightline::test {

/// Random lenses of every family, as wild as they come without folding inside the image.
inline CameraModel random_lens(Dice& dice) {
  const bool large = dice.uniform(0, 1) < 0.25;
  const int width = large ? 1280 : 640;
  const int height = large ? 720 : 480;
  const double focal = dice.uniform(0.45, 1.6) * width;
  const double kind = dice.uniform(0, 3);
  const auto small = [&] { return dice.uniform(-5e-4, 5e-4); };
  if (kind < 1.5) {
    const double k1 = dice.uniform(-0.35, 0.1);
    return camera(lens(width, height, focal,
                       {k1, dice.uniform(0.3, 0.5) * k1 * k1 + 0.02, small(), small(),
                        dice.uniform(-0.01, 0.01)}));
  }
  if (kind < 2.3) {
    return camera(lens(width, height, 0.5 * focal,
                       {dice.uniform(-0.02, 0.03), dice.uniform(-0.006, 0.002), 0.001, -0.0002},
                       LensModel::kFisheye));
  }
  return camera(lens(width, height, focal,
                     {dice.uniform(0.2, 0.5), dice.uniform(-0.2, 0), small(), small(), 0.01,
                      dice.uniform(0.3, 0.6), -0.1, 0.02},
                     LensModel::kRational));
}

/// Adds a box turned and moved, so that several can go through one another.
inline void add_turned_box(TriangleMesh& mesh, const Eigen::Vector3f& size,
                           const Eigen::Quaterniond& turn, const Eigen::Vector3d& place) {
  const TriangleMesh box = make_box(size);
  const auto base = static_cast<uint32_t>(mesh.vertices.size());
  for (const Eigen::Vector3f& v : box.vertices)
    mesh.vertices.push_back((turn * v.cast<double>() + place).cast<float>());
  for (const auto& f : box.faces) mesh.faces.push_back({f[0] + base, f[1] + base, f[2] + base});
}

/// Three boxes that cut one another.
inline TriangleMesh make_crossing_boxes(Dice& dice) {
  TriangleMesh mesh;
  for (int i = 0; i < 3; ++i) {
    const auto side = [&] { return static_cast<float>(dice.uniform(0.05, 0.3)); };
    const auto shift = [&] { return dice.uniform(-0.05, 0.05); };
    add_turned_box(mesh, {side(), side(), side()}, dice.rotation(), {shift(), shift(), shift()});
  }
  return finish_mesh(std::move(mesh), "crossing boxes").value();
}

/// An open box: two faces missing, both sides of the others seen.
inline TriangleMesh make_open_box() {
  TriangleMesh box = make_box({0.25f, 0.2f, 0.15f});
  box.faces.resize(8);
  box.face_normals.resize(8);
  return finish_mesh(std::move(box), "open box").value();
}

/// Boxes, a concave closed surface coarse and fine, and what cuts itself.
inline std::vector<RenderMesh> random_meshes(Dice& dice) {
  std::vector<RenderMesh> meshes;
  const auto side = [&] { return static_cast<float>(dice.uniform(0.05, 0.4)); };
  meshes.push_back(make_render_mesh(make_box({side(), side(), side()})));
  meshes.push_back(make_render_mesh(make_bumpy_torus(300, 0.15f)));
  meshes.push_back(make_render_mesh(make_bumpy_torus(10'000, 0.15f)));
  meshes.push_back(make_render_mesh(make_crossing_boxes(dice)));
  meshes.push_back(make_render_mesh(make_open_box()));
  return meshes;
}

/// A texture of noise on every other face, colors of the corners on the rest.
inline void paint_with_noise(Dice& dice, RenderMesh& mesh) {
  Image image(64, 64);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x)
      image.mutable_view().y.row(y)[x] = static_cast<uint8_t>(dice.uniform(16, 235));
  }
  for (const MutablePlaneView& plane : {image.mutable_view().u, image.mutable_view().v}) {
    for (int y = 0; y < plane.height; ++y) std::fill_n(plane.row(y), plane.width, uint8_t{110});
  }
  mesh.textures = {std::make_shared<const SurfaceTexture>(image.view())};
  mesh.paint.resize(mesh.faces.size());
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    mesh.paint[f].texture = f % 2 == 0 ? 0 : -1;
    for (size_t k = 0; k < 3; ++k) {
      mesh.paint[f].places[k] = {static_cast<float>(dice.uniform(-1, 2)),
                                 static_cast<float>(dice.uniform(-1, 2))};
      mesh.paint[f].colors[k] = {static_cast<uint8_t>(dice.uniform(16, 235)), 100, 150};
    }
  }
}

/// Mostly in the image and up to half of it wide, sometimes around the camera itself.
inline Rigid3 random_pose(Dice& dice, const CameraModel& model, const RenderMesh& mesh) {
  if (dice.uniform(0, 1) < 0.1) {
    return {dice.rotation(), Eigen::Vector3d(dice.uniform(-0.3, 0.3), dice.uniform(-0.3, 0.3),
                                             dice.uniform(-0.1, 0.3))};
  }
  const double diameter_px = dice.uniform(20, 0.5 * model.width());
  const double depth = 2 * double{mesh.radius} * model.parameters().fx / diameter_px;
  const Eigen::Vector2d pixel(dice.uniform(0, model.width()), dice.uniform(0, model.height()));
  return pose_at(model, pixel, depth, dice.rotation());
}

}  // namespace sightline::test
