// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <map>

#include "render/ray_cast.hpp"
#include "render/render_support.hpp"
#include "sightline/render/raster/raster.hpp"
#include "sightline/render/raster/static_depth.hpp"

namespace sightline {
namespace {

double length(const EdgeSegment& s) { return std::hypot(s.x1 - s.x0, s.y1 - s.y0); }

class MeshEdgesTest : public testing::Test {
 protected:
  MeshEdgesTest() : model(test::camera(test::lens_a())) {
    static const auto table = RayTable::build(model);
    rays = table;
  }

  void draw(const RenderMesh& mesh, const Rigid3& pose) {
    MeshRasterizer rasterizer(rays);
    rasterizer.render(mesh, pose, 4, tile);
    edges.clear();
    visible_edges(*rays, mesh, pose, tile, edges);
  }

  CameraModel model;
  std::shared_ptr<const RayTable> rays;
  RasterTile tile;
  std::vector<EdgeSegment> edges;
};

TEST_F(MeshEdgesTest, ABoxHasTwelveFeatureEdgesAndShowsNine) {
  const RenderMesh mesh = make_render_mesh(make_box({0.2f, 0.25f, 0.3f}));
  ASSERT_EQ(mesh.feature_edges.size(), 12u);
  test::Dice dice(7);
  int general = 0;
  for (int i = 0; i < 60; ++i) {
    const Rigid3 pose = test::pose_at(model, {dice.uniform(250, 1000), dice.uniform(250, 500)},
                                      dice.uniform(0.8, 2), dice.rotation());
    // General position: three faces in front, none of them nearly edge-on.
    const Eigen::Vector3d eye = pose.inverse() * Eigen::Vector3d::Zero();
    int front = 0;
    bool grazing = false;
    for (uint32_t f = 0; f < mesh.faces.size(); f += 2) {
      const double side = mesh.normal(f).dot(eye - mesh.vertex(mesh.faces[f][0])) / eye.norm();
      front += side > 0 ? 1 : 0;
      grazing = grazing || std::abs(side) < 0.1;
    }
    if (front != 3 || grazing) continue;
    ++general;
    draw(mesh, pose);
    std::map<uint32_t, std::pair<double, double>> drawn;  // per edge: visible and hidden length
    for (const EdgeSegment& s : edges)
      (s.visible ? drawn[s.line].first : drawn[s.line].second) += length(s);
    ASSERT_EQ(drawn.size(), 12u);
    int visible = 0, hidden = 0;
    for (const auto& [line, lengths] : drawn) {
      if (lengths.second == 0) ++visible;
      if (lengths.first == 0) ++hidden;
    }
    EXPECT_EQ(visible, 9) << "pose " << i;
    EXPECT_EQ(hidden, 3) << "pose " << i;
  }
  EXPECT_GE(general, 10);
}

TEST_F(MeshEdgesTest, PiecesStayOnTheTrueCurve) {
  const RenderMesh mesh = make_render_mesh(make_box({0.8f, 0.5f, 0.6f}));
  test::Dice dice(8);
  for (int i = 0; i < 10; ++i) {
    const Rigid3 pose = test::pose_at(model, {dice.uniform(100, 1180), dice.uniform(100, 620)}, 1.2,
                                      dice.rotation());
    draw(mesh, pose);
    ASSERT_FALSE(edges.empty());
    for (const EdgeSegment& s : edges) {
      // The ray through the piece's middle passes the edge in space within a tenth of a pixel.
      const FeatureEdge& edge = mesh.feature_edges[s.line];
      const Eigen::Vector2d middle(0.5 * double{s.x0 + s.x1}, 0.5 * double{s.y0 + s.y1});
      if (!model.contains(middle)) continue;
      const Eigen::Vector3d ray = model.unproject(middle).value();
      const Eigen::Vector3d a = pose * mesh.vertex(edge.start);
      const Eigen::Vector3d b = pose * mesh.vertex(edge.end);
      // Point of the edge nearest to the plane's ray: where ray and edge are closest.
      const Eigen::Vector3d d = b - a;
      const Eigen::Matrix<double, 3, 2> basis =
          (Eigen::Matrix<double, 3, 2>() << d, -ray).finished();
      const Eigen::Vector2d at = basis.colPivHouseholderQr().solve(-a);
      const auto pixel = model.project(a + at.x() * d);
      ASSERT_TRUE(pixel.has_value());
      EXPECT_LT((*pixel - middle).norm(), 0.1);
    }
  }
}

TEST_F(MeshEdgesTest, PiecesOfOneLineTouch) {
  draw(make_render_mesh(make_box({0.3f, 0.3f, 0.3f})),
       Rigid3(Eigen::Quaterniond(0.8, 0.3, 0.4, 0.1), {0.1, 0.1, 1}));
  for (size_t i = 1; i < edges.size(); ++i) {
    if (edges[i].line != edges[i - 1].line) continue;
    EXPECT_EQ(edges[i].x0, edges[i - 1].x1);
    EXPECT_EQ(edges[i].y0, edges[i - 1].y1);
  }
}

TEST_F(MeshEdgesTest, EdgesBehindAnotherPartAreHidden) {
  // Two boxes in one mesh: the near one covers the middle of the far one.
  TriangleMesh far_box = make_box({0.6f, 0.1f, 0.1f});
  const TriangleMesh near_box = make_box({0.2f, 0.4f, 0.1f});
  const auto first = static_cast<uint32_t>(far_box.vertices.size());
  for (const Eigen::Vector3f& v : near_box.vertices)
    far_box.vertices.push_back(v - Eigen::Vector3f(0, 0, 0.5f));
  for (const auto& f : near_box.faces)
    far_box.faces.push_back({f[0] + first, f[1] + first, f[2] + first});
  far_box.normals.clear();
  far_box.face_normals.clear();
  const RenderMesh mesh = make_render_mesh(finish_mesh(far_box, "two boxes").value());
  draw(mesh, Rigid3(Eigen::Quaterniond::Identity(), {0, 0, 1.5}));
  double hidden = 0, visible = 0;
  for (const EdgeSegment& s : edges) {
    const FeatureEdge& edge = mesh.feature_edges[s.line];
    // The far box's long edges on its front side.
    if (edge.start >= first || mesh.z[edge.start] > 0 || mesh.z[edge.end] > 0 ||
        mesh.x[edge.start] == mesh.x[edge.end])
      continue;
    (s.visible ? visible : hidden) += length(s);
  }
  // Seen from 1.45 m the far edge is 0.6 m long; the near box covers 0.2 m at 0.95 m.
  EXPECT_NEAR(hidden / (hidden + visible), 0.2 / 0.95 * 1.45 / 0.6, 0.02);
}

TEST_F(MeshEdgesTest, LinesAreCutAtTheNearPlaneAndTheFold) {
  const auto wide = RayTable::build(test::camera(test::lens_c()));
  edges.clear();
  project_line(*wide, {0.1, 0.1, 1}, {-0.3, 0.2, -1}, 5, nullptr, 0, edges);
  ASSERT_FALSE(edges.empty());
  for (const EdgeSegment& s : edges) {
    EXPECT_EQ(s.line, 5u);
    EXPECT_TRUE(s.visible);
    EXPECT_LT(length(s), 400);
  }
  edges.clear();
  project_line(*wide, {3.5, -1, 1}, {3.5, 1, 1}, 0, nullptr, 0, edges);
  EXPECT_TRUE(edges.empty()) << "beyond the fold";
  project_line(*wide, {0, 0, -1}, {0.2, 0, -0.5}, 0, nullptr, 0, edges);
  EXPECT_TRUE(edges.empty()) << "behind the camera";
  project_line(*wide, {0, 0, 1}, {0, 0, 1}, 0, nullptr, 0, edges);
  EXPECT_LE(edges.size(), 1u) << "no length";
}

TEST_F(MeshEdgesTest, LinesHideBehindTheTile) {
  MeshRasterizer rasterizer(rays);
  const RenderMesh mesh = make_render_mesh(make_box({0.3f, 0.3f, 0.3f}));
  rasterizer.render(mesh, Rigid3(Eigen::Quaterniond::Identity(), {0, 0, 1}), 4, tile);
  edges.clear();
  project_line(*rays, {-0.5, 0, 1.5}, {0.5, 0, 1.5}, 0, &tile, 0.01, edges);
  double hidden = 0, visible = 0;
  for (const EdgeSegment& s : edges) (s.visible ? visible : hidden) += length(s);
  EXPECT_NEAR(hidden / (hidden + visible), 0.3 / 0.85 * 1.5 / 1.0, 0.02);
  edges.clear();
  project_line(*rays, {-0.5, 0, 0.7}, {0.5, 0, 0.7}, 0, &tile, 0.01, edges);
  for (const EdgeSegment& s : edges) EXPECT_TRUE(s.visible);
}

TEST(StaticDepthTest, MeasuredDepthCountsWhereItIsNearer) {
  const auto rays = RayTable::build(test::camera(test::lens_a()));
  const auto pixels = static_cast<size_t>(rays->width()) * static_cast<size_t>(rays->height());
  std::vector<float> measured(pixels, 0);
  const size_t there = size_t{354} * static_cast<size_t>(rays->width()) + 643;
  measured[there] = 2.0f;
  const auto depth = StaticDepth::build(rays, Rigid3(), {}, measured);
  EXPECT_FALSE(depth->empty());
  EXPECT_EQ(depth->row(354)[643], 0.5f);
  EXPECT_EQ(depth->row(354)[644], 0.0f);
  const RenderMesh wall = make_render_mesh(make_box({6, 4, 0.5f}));
  const SceneMesh scene{&wall, Rigid3(Eigen::Quaterniond::Identity(), {0, 0, 1.25})};
  measured[there + 1] = 0.5f;
  const auto both = StaticDepth::build(rays, Rigid3(), {&scene, 1}, measured);
  EXPECT_NEAR(both->row(354)[643], 1.0f, 1e-5f);  // the wall, at 1 m
  EXPECT_EQ(both->row(354)[644], 2.0f);
}

TEST(StaticDepthTest, HoldsTheNearestStaticSurface) {
  const CameraModel model = test::camera(test::lens_a());
  const auto rays = RayTable::build(model);
  EXPECT_TRUE(StaticDepth::build(rays, Rigid3(), {})->empty());
  const RenderMesh wall = make_render_mesh(make_box({6, 4, 0.1f}));
  const RenderMesh post = make_render_mesh(make_box({0.1f, 1, 0.1f}));
  // The camera stands two meters before the wall, looking along world Y.
  const Rigid3 world_from_camera(
      Eigen::Quaterniond(Eigen::AngleAxisd(-std::numbers::pi / 2, Eigen::Vector3d::UnitX())),
      {0, -2, 1});
  const Rigid3 level = world_from_camera;
  const std::array<SceneMesh, 2> scene = {
      SceneMesh{&wall, level * Rigid3(Eigen::Quaterniond::Identity(), {0, 0, 2})},
      SceneMesh{&post, level * Rigid3(Eigen::Quaterniond::Identity(), {0, 0, 1})}};
  const auto depth = StaticDepth::build(rays, world_from_camera, scene);
  EXPECT_FALSE(depth->empty());
  EXPECT_EQ(depth->width(), 1280);
  EXPECT_EQ(depth->height(), 720);
  EXPECT_NEAR(double{depth->row(354)[643]}, 1 / 0.95, 1e-4);
  EXPECT_NEAR(double{depth->row(354)[900]}, 1 / 1.95, 1e-4);
}

}  // namespace
}  // namespace sightline
