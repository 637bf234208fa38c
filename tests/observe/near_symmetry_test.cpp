// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/shape/near_symmetry.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "support/scene_shapes.hpp"

namespace sightline {
namespace {

NearSymmetries find(const TriangleMesh& mesh) {
  const auto renderable = std::make_shared<const RenderMesh>(make_render_mesh(mesh));
  return find_near_symmetries(mesh, mesh_depth_renderer_factory(renderable)).value();
}

TEST(NearSymmetry, OfABoxItsHalfTurnsDifferByNothing) {
  const NearSymmetries found = find(make_box({0.16f, 0.10f, 0.12f}));
  EXPECT_TRUE(found.axes.empty());
  ASSERT_GE(found.turns.size(), 3u);
  for (size_t i = 0; i < 3; ++i) {
    const NearSymmetry& turn = found.turns[i];
    EXPECT_NEAR(turn.turn.angle(), std::numbers::pi, 0.01);
    EXPECT_NEAR(turn.turn.axis().cwiseAbs().maxCoeff(), 1, 0.01);
    EXPECT_LT(turn.mean.silhouette, 0.01);
    EXPECT_LT(turn.mean.surface, 0.02);
  }
}

TEST(NearSymmetry, OnlyTheHandleTellsTheTurnOfACup) {
  const NearSymmetries found =
      find(test::make_column_with_box({0.036f, 0, 0}, {0.014f, 0.006f, 0.05f}));
  ASSERT_EQ(found.axes.size(), 1u);
  const NearSymmetry& axis = found.axes[0];
  EXPECT_GT(std::abs(axis.turn.axis().z()), 0.98);
  EXPECT_GT(axis.mean.silhouette, 0.005) << "the handle";
  EXPECT_LT(axis.mean.silhouette, 0.15);
  EXPECT_GT(axis.most, 1.3 * axis.mean.silhouette);
  EXPECT_LT(axis.least, 0.6 * axis.mean.silhouette) << "somewhere the body hides it";
}

TEST(NearSymmetry, WhatHasNoneHasNone) {
  const NearSymmetries found =
      find(test::make_column_with_box({0.07f, 0.02f, 0.06f}, {0.12f, 0.02f, 0.03f}));
  EXPECT_TRUE(found.axes.empty());
  for (const NearSymmetry& turn : found.turns) EXPECT_GT(turn.mean.silhouette, 0.05);
}

TEST(NearSymmetry, AMeshWithoutSurfaceIsRefused) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}};
  EXPECT_FALSE(find_near_symmetries(mesh, {}));
}

}  // namespace
}  // namespace sightline
