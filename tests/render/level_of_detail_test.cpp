// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/mesh/level_of_detail.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "render/mesh/surface_distance.hpp"
#include "render/overlay_scene.hpp"
#include "render/render_support.hpp"
#include "render/test_images.hpp"

namespace sightline {
namespace {

using test::Dice;

std::shared_ptr<const RenderMesh> torus(size_t faces) {
  return std::make_shared<const RenderMesh>(make_render_mesh(make_bumpy_torus(faces, 0.1f)));
}

TEST(SurfaceDistance, TriangleMatchesItsSamples) {
  Dice dice(3);
  const auto point = [&] {
    return Eigen::Vector3d(dice.uniform(-1, 1), dice.uniform(-1, 1), dice.uniform(-1, 1));
  };
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d a = point(), b = point(), c = point(), p = 2 * point();
    double sampled = 1e9;
    constexpr int kSteps = 60;
    for (int u = 0; u <= kSteps; ++u) {
      for (int v = 0; u + v <= kSteps; ++v)
        sampled = std::min(sampled, (a + (b - a) * u / kSteps + (c - a) * v / kSteps - p).norm());
    }
    const double exact = distance_to_triangle(p, a, b, c);
    EXPECT_LE(exact, sampled + 1e-12);
    EXPECT_GE(exact, sampled - 0.04);
  }
}

TEST(SurfaceDistance, GridFindsWhatAllFacesGive) {
  const auto mesh = torus(500);
  const SurfaceDistance distance(*mesh);
  Dice dice(4);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d p(dice.uniform(-0.15, 0.15), dice.uniform(-0.15, 0.15),
                            dice.uniform(-0.1, 0.1));
    double nearest = 1e9;
    for (const auto& f : mesh->faces)
      nearest = std::min(nearest, distance_to_triangle(p, mesh->vertex(f[0]), mesh->vertex(f[1]),
                                                       mesh->vertex(f[2])));
    EXPECT_NEAR(distance(p), nearest, 1e-12);
  }
}

TEST(LevelOfDetail, GetCoarserAndSayByHowMuch) {
  const LevelOfDetail levels(torus(20'000));
  ASSERT_GE(levels.levels().size(), 4u);
  EXPECT_EQ(levels.levels().front().error, 0);
  for (size_t i = 1; i < levels.levels().size(); ++i) {
    const auto& level = levels.levels()[i];
    EXPECT_LT(level.mesh->faces.size(), levels.levels()[i - 1].mesh->faces.size());
    EXPECT_GE(level.error, levels.levels()[i - 1].error);
    EXPECT_GT(level.error, 0);
    EXPECT_LE(level.error, 0.02 * 0.1);
    EXPECT_TRUE(level.mesh->cull_back_faces);
  }
}

TEST(LevelOfDetail, SmallMeshesAndBoxesStayAsTheyAre) {
  const auto box = std::make_shared<const RenderMesh>(make_render_mesh(make_box({1, 1, 1})));
  EXPECT_EQ(LevelOfDetail(box).levels().size(), 1u);
}

/// Coarse faces bend more at their edges; the wireframe must not fill with them.
TEST(LevelOfDetail, CreasesAreThoseOfTheFullMesh) {
  const auto smooth = std::make_shared<const RenderMesh>(
      make_render_mesh(make_bumpy_torus(20'000, 0.1f), {.crease_angle = 1.0f}));
  ASSERT_TRUE(smooth->feature_edges.empty());
  const LevelOfDetail levels(smooth);
  ASSERT_GE(levels.levels().size(), 4u);
  for (const auto& level : levels.levels()) EXPECT_TRUE(level.mesh->feature_edges.empty());
}

TEST(LevelOfDetail, NearerIsFiner) {
  const LevelOfDetail levels(torus(20'000));
  const auto rays = RayTable::build(test::camera(test::lens_a()));
  size_t before = 1u << 30;
  for (double depth = 0.15; depth < 20; depth *= 1.3) {
    const Rigid3 pose(Eigen::Quaterniond::Identity(), {0, 0, depth});
    const size_t faces = levels.choose(rays->model(), pose, 0.25).faces.size();
    EXPECT_LE(faces, before);
    before = faces;
    EXPECT_EQ(levels.choose(rays->model(), pose, 0).faces.size(),
              levels.levels()[0].mesh->faces.size());
  }
  EXPECT_LT(before, 2000u);
  const Rigid3 around(Eigen::Quaterniond::Identity(), {0, 0, 0.05});
  EXPECT_EQ(levels.choose(rays->model(), around, 0.25).faces.size(),
            levels.levels()[0].mesh->faces.size());
}

struct Silhouettes {
  size_t covered = 0, outline = 0, differing = 0, far = 0;
  double shade = 0;
};

bool covers(const RasterTile& tile, int x, int y) {
  return x >= 0 && y >= 0 && x < tile.width() && y < tile.height() && tile.inverse_depth(y)[x] > 0;
}

/// `far`: pixels that differ with no border of the full mesh's silhouette within a pixel.
void compare(const RasterTile& full, const RasterTile& coarse, Silhouettes& sum) {
  for (int y = 0; y < full.height(); ++y) {
    for (int x = 0; x < full.width(); ++x) {
      const bool in = covers(full, x, y);
      bool border = false;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) border = border || covers(full, x + dx, y + dy) != in;
      }
      if (in) ++sum.covered;
      if (in && border) ++sum.outline;
      if (in == covers(coarse, x, y)) {
        if (in) sum.shade += std::abs(int{full.shade(y)[x]} - int{coarse.shade(y)[x]});
        continue;
      }
      ++sum.differing;
      if (!border) ++sum.far;
    }
  }
}

/// The level that is chosen at a distance against the full mesh, in strong lenses and at their
/// borders: silhouettes are less than a quarter of a pixel apart.
TEST(LevelOfDetail, TheChangeOfLevelIsNotSeen) {
  const auto mesh = torus(100'000);
  const LevelOfDetail levels(mesh);
  Dice dice(5);
  for (const auto& lens : {test::lens_a(), test::lens_c(), test::lens_fisheye()}) {
    const CameraModel model = test::camera(lens);
    MeshRasterizer rasterizer(RayTable::build(model));
    RasterTile full, coarse;
    Silhouettes sum;
    size_t fewest = mesh->faces.size();
    for (int i = 0; i < 16; ++i) {
      const Eigen::Vector2d pixel(dice.uniform(0, model.width()), dice.uniform(0, model.height()));
      const double depth = 0.2 * lens.fx / dice.uniform(40, 300);
      const Rigid3 pose = test::pose_at(model, pixel, depth, dice.rotation());
      const RenderMesh& chosen = levels.choose(rasterizer.rays().model(), pose, 0.25);
      fewest = std::min(fewest, chosen.faces.size());
      const TileRect rect = rasterizer.bounds(*mesh, pose, 2);
      full.reset(rect);
      coarse.reset(rect);
      ASSERT_TRUE(rasterizer.draw(*mesh, pose, full).has_value());
      ASSERT_TRUE(rasterizer.draw(chosen, pose, coarse).has_value());
      compare(full, coarse, sum);
    }
    std::printf(
        "%zu pixels, %zu on the outline: %zu differ, %zu far from it; shade by %.2f of 255\n",
        sum.covered, sum.outline, sum.differing, sum.far,
        sum.shade / static_cast<double>(sum.covered));
    EXPECT_LT(fewest, mesh->faces.size() / 10);
    EXPECT_GT(sum.outline, 3000u);
    EXPECT_LT(static_cast<double>(sum.differing), 0.25 * static_cast<double>(sum.outline));
    EXPECT_EQ(sum.far, 0u);
    EXPECT_LT(sum.shade / static_cast<double>(sum.covered), 12);
  }
}

/// A million faces cost what their pixels cost: the same level as of a tenth of them.
TEST(LevelOfDetail, TheRendererDrawsTheChosenLevel) {
  test::OverlayScene scene;
  const auto mesh = torus(50'000);
  const auto levels = std::make_shared<const LevelOfDetail>(mesh);
  scene.mesh = mesh;
  const OverlayStyle style = test::only({"fill", "outline"});
  const PoseTrackPtr track =
      test::track_of({test::estimate_at(test::pose_at(0, 0, 0.8), TrackState::kTracking)});
  const auto image = [&](double detail_px) {
    RenderOptions options;
    options.detail_px = detail_px;
    auto renderer = CameraRenderer::create(scene.camera, CameraId(0),
                                           {{ObjectId(7), "torus", mesh, style, levels}},
                                           scene.rays, nullptr, options)
                        .value();
    auto out = std::make_unique<test::GrayImage>(320, 240, 128);
    std::vector<PoseAt> poses;
    renderer->draw(out->mutable_view(), time_from_ns(test::kCapture), std::span(&track, 1), poses);
    return out;
  };
  const auto full = image(0);
  const auto coarse = image(0.25);
  int worst = 0;
  size_t differing = 0;
  test::for_each_luma(full->view(), [&](int x, int y, int luma) {
    const int off = std::abs(luma - int{coarse->view().y.row(y)[x]});
    worst = std::max(worst, off);
    if (off > 0) ++differing;
  });
  EXPECT_GT(differing, 0u);
  EXPECT_LT(worst, 100);
}

}  // namespace
}  // namespace sightline
