// SPDX-License-Identifier: Apache-2.0
#include "observe/shape/self_symmetry.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "support/scene_shapes.hpp"

namespace sightline::observe {
namespace {

constexpr double kDeg = std::numbers::pi / 180;

TriangleMesh moved(TriangleMesh mesh, const Rigid3& pose) {
  for (Eigen::Vector3f& vertex : mesh.vertices) {
    vertex = (pose * Eigen::Vector3d(vertex.cast<double>())).cast<float>();
  }
  mesh.normals.clear();
  mesh.face_normals.clear();
  return finish_mesh(std::move(mesh), "moved").value();
}

Rigid3 odd_pose() {
  Vector6 off;
  off << 0.4, -0.7, 1.1, 0.03, 0.02, -0.05;
  return Rigid3::exp(off);
}

// A prism of `sides` about z, with a lid that is drawn in by `taper`.
TriangleMesh prism(int sides, float radius, float height, float taper) {
  TriangleMesh mesh;
  for (int level = 0; level < 2; ++level) {
    for (int i = 0; i < sides; ++i) {
      const auto angle = static_cast<float>(2 * std::numbers::pi * i / sides);
      const float r = radius * (level == 1 ? taper : 1.0f);
      mesh.vertices.emplace_back(r * std::cos(angle), r * std::sin(angle),
                                 (static_cast<float>(level) - 0.5f) * height);
    }
  }
  const auto n = static_cast<uint32_t>(sides);
  for (uint32_t i = 0; i < n; ++i) {
    const uint32_t k = (i + 1) % n;
    mesh.faces.push_back({i, k, n + k});
    mesh.faces.push_back({i, n + k, n + i});
    if (i > 0 && k != 0) {
      mesh.faces.push_back({0, k, i});
      mesh.faces.push_back({n, n + i, n + k});
    }
  }
  return finish_mesh(std::move(mesh), "prism").value();
}

TEST(SelfSymmetry, ABoxHasThreeHalfTurns) {
  const Rigid3 pose = odd_pose();
  const SelfSymmetry found = find_self_symmetry(moved(make_box({0.16f, 0.10f, 0.12f}), pose));
  EXPECT_FALSE(found.axis);
  ASSERT_EQ(found.rotations.size(), 3u);
  for (const Rigid3& transform : found.rotations) {
    const Rigid3 in_box = pose.inverse() * transform * pose;
    EXPECT_NEAR(rotation_angle(in_box, Rigid3()), std::numbers::pi, 0.1 * kDeg);
    EXPECT_LT(in_box.translation.norm(), 1e-4);
    EXPECT_GT(Eigen::AngleAxisd(in_box.rotation).axis().cwiseAbs().maxCoeff(), 0.99999);
  }
}

TEST(SelfSymmetry, RegularShapes) {
  EXPECT_EQ(find_self_symmetry(make_box({0.1f, 0.1f, 0.1f})).rotations.size(), 23u);
  EXPECT_EQ(find_self_symmetry(make_box({0.1f, 0.1f, 0.16f})).rotations.size(), 7u);
  EXPECT_EQ(find_self_symmetry(prism(3, 0.05f, 0.12f, 0.6f)).rotations.size(), 2u);
  EXPECT_EQ(find_self_symmetry(prism(5, 0.05f, 0.12f, 1.0f)).rotations.size(), 9u);
}

TEST(SelfSymmetry, RoundShapesHaveAnAxis) {
  const SelfSymmetry cone = find_self_symmetry(moved(prism(64, 0.05f, 0.12f, 0.6f), odd_pose()));
  ASSERT_TRUE(cone.axis);
  EXPECT_TRUE(cone.rotations.empty());
  const Eigen::Vector3d axis = odd_pose().rotation * Eigen::Vector3d::UnitZ();
  EXPECT_GT(std::abs(cone.axis->dot(axis)), std::cos(1 * kDeg));
  const SelfSymmetry tube = find_self_symmetry(prism(64, 0.05f, 0.12f, 1.0f));
  ASSERT_TRUE(tube.axis);
  ASSERT_EQ(tube.rotations.size(), 1u);  // end for end
  EXPECT_LT((tube.rotations[0].rotation * *tube.axis).dot(*tube.axis), -0.999);
  const SelfSymmetry bottle = find_self_symmetry(test::make_bottle(6000));
  EXPECT_TRUE(bottle.axis);
  EXPECT_TRUE(bottle.rotations.empty());
}

TEST(SelfSymmetry, IrregularShapesHaveNone) {
  for (const TriangleMesh& mesh :
       {test::make_creature(3000), test::make_truck(), test::make_bracket()}) {
    const SelfSymmetry found = find_self_symmetry(mesh);
    EXPECT_FALSE(found.axis);
    EXPECT_TRUE(found.rotations.empty());
  }
}

TEST(SelfSymmetry, AHandleTells) {
  // A box with a block on one face, a tenth of the face's area.
  TriangleMesh mesh = make_box({0.16f, 0.10f, 0.12f});
  const TriangleMesh block = make_box({0.05f, 0.02f, 0.04f});
  const auto first = static_cast<uint32_t>(mesh.vertices.size());
  for (const Eigen::Vector3f& vertex : block.vertices) {
    mesh.vertices.push_back(vertex + Eigen::Vector3f(0.04f, 0.06f, 0.03f));
  }
  for (auto face : block.faces) {
    for (uint32_t& corner : face) corner += first;
    mesh.faces.push_back(face);
  }
  mesh.normals.clear();
  mesh.face_normals.clear();
  const SelfSymmetry found = find_self_symmetry(finish_mesh(std::move(mesh), "handle").value());
  EXPECT_TRUE(found.rotations.empty());
  EXPECT_FALSE(found.axis);
}

}  // namespace
}  // namespace sightline::observe
