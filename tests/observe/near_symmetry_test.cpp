// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/shape/near_symmetry.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numbers>

#include "sightline/geometry/mesh_surface.hpp"
#include "sightline/observe/shape/symmetry_comparison.hpp"
#include "sightline/pipeline/mesh_color_renderer.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "sightline/render/mesh/mesh_paint.hpp"
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
  EXPECT_FALSE(SymmetryComparer::create(Eigen::Vector3d::Zero(), 0, 64, {}));
}

Rigid3 about(const Eigen::Vector3d& axis, double angle) {
  return Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis)), Eigen::Vector3d::Zero());
}

SymmetryComparer comparer_of(const RenderMesh& mesh, bool colors) {
  const auto shared = std::make_shared<const RenderMesh>(mesh);
  return SymmetryComparer::create(
             mesh.center.cast<double>(), double{mesh.radius}, 128,
             mesh_depth_renderer_factory(shared),
             colors ? mesh_color_renderer_factory(shared) : ColorRendererFactory())
      .value();
}

TEST(SymmetryComparison, SaysFromWhereWhatBreaksItIsSeen) {
  SymmetryComparer comparer = comparer_of(
      make_render_mesh(test::make_column_with_box({0.036f, 0, 0}, {0.014f, 0.006f, 0.05f})), false);
  std::vector<Rigid3> turns;
  for (int i = 1; i < 12; ++i) {
    turns.push_back(about(Eigen::Vector3d::UnitZ(), i * std::numbers::pi / 6));
  }
  const SymmetryBreaking told = comparer.from_all_sides(turns);
  EXPECT_LT(told.hidden_from.x(), -0.5) << "the body hides the handle";
  EXPECT_LT(told.least, 0.02);
  EXPECT_GT(told.most, 0.05);
  EXPECT_EQ(told.color, 0);
  ASSERT_TRUE(told.centroid);
  EXPECT_GT(told.centroid->x(), 0.025) << "the handle, in the object's frame";

  // A quarter turn, seen along the axis: the handle is only here, then only there.
  const SymmetryComparison quarter = comparer.compare(Eigen::Vector3d::UnitZ(), turns[2]);
  const auto count = [&](SymmetryComparison::Pixel kind) {
    return static_cast<double>(std::count(quarter.pixels.begin(), quarter.pixels.end(), kind));
  };
  EXPECT_GT(count(SymmetryComparison::Pixel::kOnlyAsIs), 50);
  EXPECT_NEAR(count(SymmetryComparison::Pixel::kOnlyAsIs),
              count(SymmetryComparison::Pixel::kOnlyTurned), 20);
}

TEST(SymmetryComparison, ColorTellsWhatTheShapeDoesNot) {
  const TriangleMesh box = make_box({0.16f, 0.10f, 0.12f});
  MeshSurface surface;  // the side along +y is orange
  for (const auto& face : box.faces) {
    SurfaceTriangle triangle;
    for (size_t i = 0; i < 3; ++i) {
      triangle.corners[i] = box.vertices[face[i]];
      triangle.places[i].setZero();
    }
    const bool label = triangle.corners[0].y() > 0.04f && triangle.corners[1].y() > 0.04f &&
                       triangle.corners[2].y() > 0.04f;
    triangle.color =
        label ? Eigen::Vector3f(0.9f, 0.42f, 0.08f) : Eigen::Vector3f(0.3f, 0.4f, 0.4f);
    triangle.corner_colors.fill(triangle.color);
    surface.triangles.push_back(triangle);
  }
  RenderMesh painted = make_render_mesh(box);
  paint_mesh(surface, {}, painted);
  const std::array half_turn = {about(Eigen::Vector3d::UnitZ(), std::numbers::pi)};

  const SymmetryBreaking shape = comparer_of(painted, false).from_all_sides(half_turn);
  EXPECT_LT(shape.most, 0.03);
  SymmetryComparer comparer = comparer_of(painted, true);
  const SymmetryBreaking told = comparer.from_all_sides(half_turn);
  EXPECT_GT(std::abs(told.shown_from.y()), 0.8);
  EXPECT_GT(told.color, 0.9);
  EXPECT_LT(told.least, 0.03) << "seen along z or x nothing tells";
  EXPECT_LT(std::abs(told.hidden_from.y()), 0.3);
}

}  // namespace
}  // namespace sightline
