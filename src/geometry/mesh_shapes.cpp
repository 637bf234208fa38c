// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>

#include "sightline/geometry/mesh.hpp"

namespace sightline {

TriangleMesh make_box(const Eigen::Vector3f& size) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3f sign((i & 1) != 0 ? 0.5f : -0.5f, (i & 2) != 0 ? 0.5f : -0.5f,
                               (i & 4) != 0 ? 0.5f : -0.5f);
    mesh.vertices.push_back(sign.cwiseProduct(size));
  }
  mesh.faces = {{0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}, {0, 1, 5}, {0, 5, 4},
                {2, 6, 7}, {2, 7, 3}, {0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}};
  return finish_mesh(std::move(mesh), "make_box").value();
}

TriangleMesh make_bumpy_torus(size_t faces, float radius) {
  constexpr double kTurn = 2 * std::numbers::pi;
  const size_t pairs = std::max<size_t>(faces, 32) / 2;
  const auto around = static_cast<size_t>(std::lround(std::sqrt(2.0 * static_cast<double>(pairs))));
  const size_t across = std::max<size_t>(3, pairs / around);
  TriangleMesh mesh;
  for (size_t i = 0; i < around; ++i) {
    for (size_t k = 0; k < across; ++k) {
      const double u = kTurn * static_cast<double>(i) / static_cast<double>(around);
      const double v = kTurn * static_cast<double>(k) / static_cast<double>(across);
      const double tube = 0.28 * (1 + 0.2 * std::sin(5 * u) * std::cos(3 * v));
      const double ring = 0.66 + tube * std::cos(v);
      mesh.vertices.push_back(
          (radius * Eigen::Vector3d(ring * std::cos(u), ring * std::sin(u), tube * std::sin(v)))
              .cast<float>());
    }
  }
  const auto index = [&](size_t i, size_t k) {
    return static_cast<uint32_t>((i % around) * across + k % across);
  };
  for (size_t i = 0; i < around; ++i) {
    for (size_t k = 0; k < across; ++k) {
      mesh.faces.push_back({index(i, k), index(i + 1, k), index(i + 1, k + 1)});
      mesh.faces.push_back({index(i, k), index(i + 1, k + 1), index(i, k + 1)});
    }
  }
  MeshOptions options;
  options.crease_angle = 1.5f;  // smooth also where few faces make it coarse
  return finish_mesh(std::move(mesh), "make_bumpy_torus", options).value();
}

}  // namespace sightline
