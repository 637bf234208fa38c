// SPDX-License-Identifier: Apache-2.0
#include "support/ray_mesh.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "support/random.hpp"
#include "support/scene_shapes.hpp"

namespace sightline::test {
namespace {

// Every face tried, in double.
double nearest_by_hand(const TriangleMesh& mesh, const Eigen::Vector3d& origin,
                       const Eigen::Vector3d& direction) {
  double nearest = 1e30;
  for (const auto& f : mesh.faces) {
    const Eigen::Vector3d a = mesh.vertices[f[0]].cast<double>();
    Eigen::Matrix3d sides;
    sides << mesh.vertices[f[1]].cast<double>() - a, mesh.vertices[f[2]].cast<double>() - a,
        -direction;
    if (std::abs(sides.determinant()) < 1e-15) continue;
    const Eigen::Vector3d s = sides.inverse() * (origin - a);
    if (s.x() < 0 || s.y() < 0 || s.x() + s.y() > 1 || s.z() <= 0) continue;
    nearest = std::min(nearest, s.z());
  }
  return nearest;
}

TEST(RayMesh, HitsWhatTryingEveryFaceHits) {
  const RayMesh mesh(make_creature(600));
  Random random(3);
  int hits = 0, disagreements = 0;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d origin = 0.3 * random.normal<3>().normalized();
    const Eigen::Vector3d direction = 0.03 * random.normal<3>() - origin;
    const double expected = nearest_by_hand(mesh.mesh(), origin, direction);
    const auto hit = mesh.cast(origin.cast<float>(), direction.cast<float>());
    const double found = hit ? static_cast<double>(hit->distance) : 1e30;
    hits += hit.has_value();
    if (std::abs(found - expected) > 1e-4 * expected) ++disagreements;
  }
  EXPECT_GT(hits, 300);
  EXPECT_LE(disagreements, 2);  // rays through an edge
}

TEST(RayMesh, TellsThePointAndTheOutwardNormal) {
  const RayMesh box(make_box({2, 2, 2}));
  const auto hit = box.cast({0.3f, 0.2f, 5}, {0, 0, -2});
  ASSERT_TRUE(hit);
  EXPECT_NEAR(hit->distance, 2.0, 1e-6);
  EXPECT_LT((hit->point - Eigen::Vector3f(0.3f, 0.2f, 1)).norm(), 1e-5f);
  EXPECT_GT(hit->normal.z(), 0.999f);
  EXPECT_FALSE(box.cast({0.3f, 0.2f, 5}, {0, 0, -2}, 1.9f));
  EXPECT_FALSE(box.cast({0.3f, 0.2f, 5}, {0, 0, 2}));
}

}  // namespace
}  // namespace sightline::test
