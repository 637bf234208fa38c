// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/mesh_distance.hpp"

#include <gtest/gtest.h>

#include "support/random.hpp"

namespace sightline {
namespace {

TEST(MeshDistance, FindsWhatTryingEveryFaceFinds) {
  const TriangleMesh mesh = make_bumpy_torus(900, 0.1f);
  const MeshDistance tree(mesh);
  test::Random random(5);
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d p = 0.08 * random.normal<3>();
    double min = 1e9;
    for (const auto& f : mesh.faces) {
      const Eigen::Vector3d on = nearest_on_triangle(p, mesh.vertices[f[0]].cast<double>(),
                                                     mesh.vertices[f[1]].cast<double>(),
                                                     mesh.vertices[f[2]].cast<double>());
      min = std::min(min, (on - p).norm());
    }
    const SurfacePoint found = tree.nearest(p);
    EXPECT_NEAR(found.distance, min, 1e-12);
    EXPECT_NEAR((found.point - p).norm(), min, 1e-12);
  }
}

// Against the minimum over a fine grid of the triangle: every region of the plane is met.
TEST(MeshDistance, NearestOnATriangleIsTheNearest) {
  test::Random random(6);
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d a = random.normal<3>(), b = random.normal<3>(), c = random.normal<3>();
    const Eigen::Vector3d p = 2 * random.normal<3>();
    const double found = (nearest_on_triangle(p, a, b, c) - p).norm();
    double min = 1e9;
    constexpr int kGrid = 60;
    for (int u = 0; u <= kGrid; ++u) {
      for (int v = 0; u + v <= kGrid; ++v) {
        const Eigen::Vector3d on = a + (b - a) * u / kGrid + (c - a) * v / kGrid;
        min = std::min(min, (on - p).norm());
      }
    }
    EXPECT_LE(found, min + 1e-12);
    EXPECT_GE(found, min - 0.12);
  }
}

TEST(MeshDistance, IsKnownForABox) {
  const MeshDistance box(make_box({2, 2, 2}));
  EXPECT_NEAR(box.nearest({0, 0, 3}).distance, 2, 1e-12);
  EXPECT_NEAR(box.nearest({0, 0, 0.75}).distance, 0.25, 1e-12);
  EXPECT_NEAR(box.nearest({2, 2, 2}).distance, std::sqrt(3.0), 1e-12);
}

}  // namespace
}  // namespace sightline
