// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/raster/raster.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <string>

#include "render/ray_cast.hpp"
#include "render/render_support.hpp"
#include "sightline/base/cpu.hpp"

namespace sightline {
namespace {

using test::CastHit;
using test::Dice;
using test::RayCaster;

/// One lens with its table and the double-precision rays of the reference.
struct Lens {
  explicit Lens(const CameraModel::Parameters& p)
      : model(test::camera(p)), rays(RayTable::build(model)) {}

  /// The reference's ray: straight from the camera model, once per pixel.
  const std::optional<Eigen::Vector3d>& ray(int x, int y) {
    if (known.empty()) {
      known.resize(static_cast<size_t>(model.width()) * static_cast<size_t>(model.height()));
      reference.resize(known.size());
    }
    const size_t i =
        static_cast<size_t>(y) * static_cast<size_t>(model.width()) + static_cast<size_t>(x);
    if (known[i] == 0) {
      known[i] = 1;
      auto r = model.unproject({x, y});
      if (r && r->z() < std::cos(89.0 * std::numbers::pi / 180)) r.reset();
      reference[i] = r;
    }
    return reference[i];
  }

  CameraModel model;
  std::shared_ptr<const RayTable> rays;
  std::vector<char> known;
  std::vector<std::optional<Eigen::Vector3d>> reference;
};

struct Comparison {
  size_t covered = 0, wrong_mask = 0, wrong_depth = 0, wrong_shade = 0;
};

/// Casts the tile's pixels and `border` more on each side, which must be empty.
void compare(Lens& lens, const RenderMesh& mesh, const Rigid3& pose, const RasterTile& tile,
             int border, Comparison& sum) {
  const RayCaster caster(mesh, pose);
  const TileRect& t = tile.rect();
  for (int y = std::max(0, t.y - border);
       y < std::min(lens.model.height(), t.y + t.height + border); ++y) {
    for (int x = std::max(0, t.x - border);
         x < std::min(lens.model.width(), t.x + t.width + border); ++x) {
      const auto& ray = lens.ray(x, y);
      const CastHit hit = ray ? caster.cast(*ray) : CastHit{};
      const bool in_tile = t.contains(x, y);
      const double drawn = in_tile ? double{tile.inverse_depth(y - t.y)[x - t.x]} : 0.0;
      if ((drawn > 0) != (hit.inverse_z > 0)) {
        if (++sum.wrong_mask < 4)
          ADD_FAILURE() << "pixel " << x << "," << y << " drawn " << drawn << " cast "
                        << hit.inverse_z << " in tile " << in_tile;
        continue;
      }
      if (hit.inverse_z == 0) continue;
      ++sum.covered;
      if (std::abs(drawn - hit.inverse_z) > 1e-4 * hit.inverse_z) ++sum.wrong_depth;
      const bool tie = hit.inverse_z - hit.second_inverse_z < 1e-5 * hit.inverse_z;
      if (!tie && std::abs(int{tile.shade(y - t.y)[x - t.x]} - hit.shade) > 1) ++sum.wrong_shade;
    }
  }
}

void expect_right(const Comparison& c, size_t min_covered) {
  EXPECT_EQ(c.wrong_mask, 0u);
  EXPECT_EQ(c.wrong_depth, 0u);
  EXPECT_EQ(c.wrong_shade, 0u);
  EXPECT_GE(c.covered, min_covered);
}

class RasterLensTest : public testing::TestWithParam<int> {
 protected:
  static Lens& lens() {
    static std::array<std::unique_ptr<Lens>, 6> all;
    auto& slot = all[static_cast<size_t>(GetParam())];
    if (!slot) {
      const std::array<CameraModel::Parameters, 6> parameters = {
          test::lens_a(),       test::lens_b(),        test::lens_c(),
          test::lens_fisheye(), test::lens_rational(), test::lens_folding()};
      slot = std::make_unique<Lens>(parameters[static_cast<size_t>(GetParam())]);
    }
    return *slot;
  }
  static Eigen::Vector2d random_pixel(Dice& dice) {
    return {dice.uniform(0, lens().model.width()), dice.uniform(0, lens().model.height())};
  }
};

INSTANTIATE_TEST_SUITE_P(Lenses, RasterLensTest, testing::Range(0, 6),
                         [](const auto& lens) { return std::string(1, "ABCFRN"[lens.param]); });

TEST_P(RasterLensTest, BoxesMatchADoublePrecisionRayCast) {
  Dice dice(17);
  MeshRasterizer rasterizer(lens().rays);
  RasterTile tile;
  Comparison sum;
  for (int i = 0; i < 14; ++i) {
    // One by one: the order of arguments differs between targets, and so would the poses.
    Eigen::Vector3f size;
    for (const int axis : {2, 1, 0}) size[axis] = static_cast<float>(dice.uniform(0.05, 0.4));
    const RenderMesh mesh = make_render_mesh(make_box(size));
    const auto turn = dice.rotation();
    const double distance = dice.uniform(0.6, 2.5);
    const Rigid3 pose = test::pose_at(lens().model, random_pixel(dice), distance, turn);
    rasterizer.render(mesh, pose, 2, tile);
    compare(lens(), mesh, pose, tile, 8, sum);
  }
  expect_right(sum, 10'000);
}

TEST_P(RasterLensTest, BoxesAtTheBorderAndCutByTheNearPlaneMatch) {
  Dice dice(18);
  MeshRasterizer rasterizer(lens().rays);
  RasterTile tile;
  Comparison sum;
  const RenderMesh mesh = make_render_mesh(make_box({0.5f, 0.3f, 0.2f}));
  for (int i = 0; i < 24; ++i) {
    // Around the camera on all sides: behind it, across its plane, and out of the image.
    const Eigen::Vector3d place(dice.uniform(-0.5, 0.5), dice.uniform(-0.4, 0.4),
                                dice.uniform(-0.2, 0.3));
    const Rigid3 pose(dice.rotation(), place);
    rasterizer.render(mesh, pose, 0, tile);
    if (tile.rect().width > 500) {  // the brute force is slow: look at a part of a large tile
      const int x = static_cast<int>(dice.uniform(0, lens().model.width() - 200));
      const int y = static_cast<int>(dice.uniform(0, lens().model.height() - 160));
      tile.reset({x & ~1, y & ~1, 200, 160});
      ASSERT_TRUE(rasterizer.draw(mesh, pose, tile).has_value());
      compare(lens(), mesh, pose, tile, 0, sum);
    } else {
      compare(lens(), mesh, pose, tile, 8, sum);
    }
  }
  expect_right(sum, 5'000);
}

TEST_P(RasterLensTest, OpenMeshesShowBothSides) {
  TriangleMesh box = make_box({0.3f, 0.3f, 0.3f});
  box.faces.resize(8);
  box.face_normals.resize(8);
  const RenderMesh mesh = make_render_mesh(finish_mesh(box, "open box").value());
  ASSERT_FALSE(mesh.cull_back_faces);
  Dice dice(19);
  MeshRasterizer rasterizer(lens().rays);
  RasterTile tile;
  Comparison sum;
  for (int i = 0; i < 6; ++i) {
    const Rigid3 pose =
        test::pose_at(lens().model, random_pixel(dice), dice.uniform(0.3, 2), dice.rotation());
    rasterizer.render(mesh, pose, 2, tile);
    compare(lens(), mesh, pose, tile, 4, sum);
  }
  expect_right(sum, 5'000);
}

TEST_P(RasterLensTest, BumpyTorusMatches) {
  const RenderMesh mesh = make_render_mesh(make_bumpy_torus(1000, 0.1f));
  Dice dice(20);
  MeshRasterizer rasterizer(lens().rays);
  RasterTile tile;
  Comparison sum;
  for (int i = 0; i < 2; ++i) {
    const double depth = 0.2 * lens().model.parameters().fx / 150;
    const Rigid3 pose = test::pose_at(lens().model, random_pixel(dice), depth, dice.rotation());
    rasterizer.render(mesh, pose, 2, tile);
    compare(lens(), mesh, pose, tile, 2, sum);
  }
  expect_right(sum, 200);
}

/// Frame pixels that differ between a small tile and the whole frame must not exist.
TEST_P(RasterLensTest, TheTileHoldsEverything) {
  Dice dice(21);
  MeshRasterizer rasterizer(lens().rays);
  RasterTile tile, frame;
  const RenderMesh torus = make_render_mesh(make_bumpy_torus(2000, 0.2f));
  const RenderMesh box = make_render_mesh(make_box({0.5f, 0.1f, 0.3f}));
  for (int i = 0; i < 30; ++i) {
    const RenderMesh& mesh = i % 2 == 0 ? torus : box;
    const Eigen::Vector3d place(dice.uniform(-1.5, 1.5), dice.uniform(-1.5, 1.5),
                                dice.uniform(-0.3, 1.0));
    const Rigid3 pose(dice.rotation(), place);
    rasterizer.render(mesh, pose, 0, tile);
    frame.reset(test::whole_frame(*lens().rays));
    ASSERT_TRUE(rasterizer.draw(mesh, pose, frame).has_value());
    size_t lost = 0, differ = 0;
    for (int y = 0; y < frame.height(); ++y) {
      for (int x = 0; x < frame.width(); ++x) {
        const float z = frame.inverse_depth(y)[x];
        const TileRect& t = tile.rect();
        if (!t.contains(x, y)) {
          lost += z > 0 ? 1 : 0;
        } else {
          const float own = tile.inverse_depth(y - t.y)[x - t.x];
          if ((own > 0) != (z > 0) || std::abs(own - z) > 1e-4f * z) ++differ;
        }
      }
    }
    EXPECT_EQ(lost, 0u) << "pose " << i;
    EXPECT_EQ(differ, 0u) << "pose " << i;
  }
}

TEST_P(RasterLensTest, AllKernelsGiveTheSameBits) {
  std::vector<RasterKernel> fast_kernels{RasterKernel::kVector};
  if (cpu_has_avx2()) fast_kernels.push_back(RasterKernel::kAvx2);
  for (const RasterKernel kernel : fast_kernels) {
    Dice dice(22);
    MeshRasterizer plain(lens().rays, RasterKernel::kScalar);
    MeshRasterizer fast(lens().rays, kernel);
    RasterTile a, b;
    const RenderMesh torus = make_render_mesh(make_bumpy_torus(3000, 0.1f));
    const RenderMesh box = make_render_mesh(make_box({0.1f, 0.2f, 0.3f}));
    for (int i = 0; i < 20; ++i) {
      const RenderMesh& mesh = i % 2 == 0 ? torus : box;
      const Rigid3 pose =
          test::pose_at(lens().model, random_pixel(dice), dice.uniform(0.05, 1.5), dice.rotation());
      plain.render(mesh, pose, 2, a);
      fast.render(mesh, pose, 2, b);
      EXPECT_TRUE(test::same_pixels(a, b)) << "pose " << i;
      EXPECT_EQ(plain.exact_pixels(), fast.exact_pixels());
      fast.render(mesh, pose, 2, a);
      EXPECT_TRUE(test::same_pixels(a, b)) << "the same call twice, pose " << i;
    }
  }
}

class RasterTest : public testing::Test {
 protected:
  RasterTest() : model(test::camera(test::lens_a())) {
    static const auto table = RayTable::build(model);
    rays = table;
  }
  size_t covered(const RasterTile& drawn) const {
    size_t n = 0;
    for (int y = 0; y < drawn.height(); ++y)
      for (int x = 0; x < drawn.width(); ++x) n += drawn.inverse_depth(y)[x] > 0 ? 1 : 0;
    return n;
  }
  CameraModel model;
  std::shared_ptr<const RayTable> rays;
  RasterTile tile;
};

TEST_F(RasterTest, NearFacesWinAndBackFacesAreCulled) {
  // Culling the wrong side keeps the outline and shows the far wall: look at the depth.
  const RenderMesh mesh = make_render_mesh(make_box({0.2f, 0.2f, 0.2f}));
  ASSERT_TRUE(mesh.cull_back_faces);
  MeshRasterizer rasterizer(rays);
  rasterizer.render(mesh, Rigid3(Eigen::Quaterniond::Identity(), {0, 0, 1}), 2, tile);
  const int x = static_cast<int>(model.parameters().cx) - tile.rect().x;
  const int y = static_cast<int>(model.parameters().cy) - tile.rect().y;
  EXPECT_NEAR(double{tile.inverse_depth(y)[x]}, 1 / 0.9, 1e-5);
  // The face turned to the camera looks straight at the light's z part.
  EXPECT_NEAR(tile.shade(y)[x], 255 * 0.8 * (kAmbient + (1 - kAmbient) * -kLightZ), 1.0);
}

TEST_F(RasterTest, TheImageIsNotMirrored) {
  // A box off to +x, +y in the camera lies right of and below the principal point.
  const RenderMesh mesh = make_render_mesh(make_box({0.05f, 0.05f, 0.05f}));
  MeshRasterizer rasterizer(rays);
  rasterizer.render(mesh, Rigid3(Eigen::Quaterniond::Identity(), {0.2, 0.1, 1}), 2, tile);
  EXPECT_GT(covered(tile), 100u);
  EXPECT_GT(tile.rect().x, model.parameters().cx);
  EXPECT_GT(tile.rect().y, model.parameters().cy);
}

TEST_F(RasterTest, NothingFoldsBackIntoTheImage) {
  // Beyond radius 2.007 the polynomial of lens C turns back: such points would land inside.
  const CameraModel wide = test::camera(test::lens_c());
  ASSERT_LT(wide.max_valid_radius(), 2.1);
  const auto table = RayTable::build(wide);
  MeshRasterizer rasterizer(table);
  const RenderMesh mesh = make_render_mesh(make_box({0.3f, 0.3f, 0.3f}));
  RasterTile frame;
  for (const double r : {2.6, 3.0, 4.0, 6.0, 20.0}) {
    for (int k = 0; k < 8; ++k) {
      const double a = k * std::numbers::pi / 4;
      const Rigid3 pose(Eigen::Quaterniond::Identity(), {r * std::cos(a), r * std::sin(a), 1.0});
      rasterizer.render(mesh, pose, 0, tile);
      EXPECT_EQ(covered(tile), 0u) << r;
      frame.reset(test::whole_frame(*table));
      ASSERT_TRUE(rasterizer.draw(mesh, pose, frame).has_value());
      EXPECT_EQ(covered(frame), 0u) << r;
    }
  }
}

TEST_F(RasterTest, BehindTheCameraThereIsNothing) {
  const RenderMesh mesh = make_render_mesh(make_box({0.3f, 0.3f, 0.3f}));
  MeshRasterizer rasterizer(rays);
  EXPECT_TRUE(
      rasterizer.bounds(mesh, Rigid3(Eigen::Quaterniond::Identity(), {0, 0, -1}), 8).empty());
  tile.reset({0, 0, 64, 64});
  ASSERT_TRUE(rasterizer.draw(mesh, Rigid3(Eigen::Quaterniond::Identity(), {0, 0, -1}), tile));
  EXPECT_EQ(covered(tile), 0u);
  // From inside a closed box only back faces are seen.
  rasterizer.render(mesh, Rigid3(Eigen::Quaterniond::Identity(), {0, 0, 0}), 0, tile);
  EXPECT_EQ(covered(tile), 0u);
}

TEST_F(RasterTest, SharedEdgesNeitherCrackNorDrawTwice) {
  // A flat open square cut into many triangles: every pixel belongs to exactly one of them, so a
  // pixel of the whole is drawn when each triangle is drawn alone exactly once.
  TriangleMesh grid;
  constexpr uint32_t kSide = 6;
  for (uint32_t j = 0; j <= kSide; ++j)
    for (uint32_t i = 0; i <= kSide; ++i)
      grid.vertices.emplace_back(static_cast<float>(i) / kSide - 0.5f,
                                 static_cast<float>(j) / kSide - 0.5f, 0.0f);
  for (uint32_t j = 0; j < kSide; ++j) {
    for (uint32_t i = 0; i < kSide; ++i) {
      const uint32_t v = j * (kSide + 1) + i;
      grid.faces.push_back({v, v + 1, v + kSide + 2});
      grid.faces.push_back({v, v + kSide + 2, v + kSide + 1});
    }
  }
  grid = finish_mesh(grid, "grid").value();
  CameraModel::Parameters plain = test::lens(256, 256, 256, {});
  plain.fy = plain.fx;
  plain.cx = plain.cy = 128;  // grid lines fall exactly on pixel centers
  const auto table = RayTable::build(test::camera(plain));
  MeshRasterizer rasterizer(table);
  const Rigid3 pose(Eigen::Quaterniond::Identity(), {0, 0, 1.3333333333333333});
  RasterTile all, one;
  all.reset(test::whole_frame(*table));
  ASSERT_TRUE(rasterizer.draw(make_render_mesh(grid), pose, all));
  std::vector<int> count(256 * 256, 0);
  for (size_t f = 0; f < grid.faces.size(); ++f) {
    TriangleMesh single = grid;
    single.faces = {grid.faces[f]};
    single.face_normals = {grid.face_normals[f]};
    one.reset(test::whole_frame(*table));
    ASSERT_TRUE(rasterizer.draw(make_render_mesh(single), pose, one));
    for (int y = 0; y < 256; ++y)
      for (int x = 0; x < 256; ++x)
        count[static_cast<size_t>(256 * y + x)] += one.inverse_depth(y)[x] > 0 ? 1 : 0;
  }
  size_t drawn = 0;
  for (int y = 0; y < 256; ++y) {
    for (int x = 0; x < 256; ++x) {
      const int n = count[static_cast<size_t>(256 * y + x)];
      EXPECT_LE(n, 1) << x << "," << y;
      EXPECT_EQ(n > 0, all.inverse_depth(y)[x] > 0) << x << "," << y;
      drawn += n > 0 ? 1 : 0;
    }
  }
  EXPECT_NEAR(static_cast<double>(drawn), 192 * 192, 2 * 192);  // the border's ties are open
  EXPECT_GT(rasterizer.exact_pixels(), 0u);
}

TEST_F(RasterTest, EmptyTilesAndOddFramesAreFine) {
  const RenderMesh mesh = make_render_mesh(make_box({3, 3, 1}));
  const auto odd = RayTable::build(test::camera(test::lens(641, 479, 500, {-0.2, 0.05})));
  MeshRasterizer rasterizer(odd);
  tile.reset({});
  ASSERT_TRUE(rasterizer.draw(mesh, Rigid3(Eigen::Quaterniond::Identity(), {0, 0, 2}), tile));
  rasterizer.render(mesh, Rigid3(Eigen::Quaterniond::Identity(), {0, 0, 2}), 4, tile);
  EXPECT_EQ(tile.rect(), (TileRect{0, 0, 642, 480}));
  EXPECT_EQ(covered(tile), 641u * 479u);  // nothing in the columns that are not there
}

TEST_F(RasterTest, DegenerateFacesAreLeftOut) {
  TriangleMesh mesh = make_box({0.2f, 0.2f, 0.2f});
  mesh.faces.push_back({0, 1, 1});
  mesh.face_normals.push_back({0, 0, 0});
  const RenderMesh prepared = make_render_mesh(mesh);
  EXPECT_EQ(prepared.faces.size(), 12u);
  EXPECT_EQ(prepared.feature_edges.size(), 12u);
}

TEST_F(RasterTest, NoPoseMakesItLeaveItsMemory) {
  // Extreme poses: sanitizers watch; nothing is asked of the image.
  Dice dice(33);
  const RenderMesh mesh = make_render_mesh(make_bumpy_torus(200, 1.0f));
  const auto fisheye = RayTable::build(test::camera(test::lens_fisheye()));
  for (const auto& table : {rays, fisheye}) {
    MeshRasterizer rasterizer(table);
    for (int i = 0; i < 200; ++i) {
      const double reach = std::pow(10.0, dice.uniform(-3, 6));
      const Rigid3 pose(dice.rotation(), {dice.uniform(-reach, reach), dice.uniform(-reach, reach),
                                          dice.uniform(-reach, reach)});
      rasterizer.render(mesh, pose, 3, tile);
      const TileRect& t = tile.rect();
      EXPECT_TRUE(t.empty() ||
                  (t.x >= 0 && t.y >= 0 && t.x % 2 == 0 && t.y % 2 == 0 && t.width % 2 == 0 &&
                   t.height % 2 == 0 && t.x + t.width <= table->even_width() &&
                   t.y + t.height <= table->even_height()));
    }
  }
}

}  // namespace
}  // namespace sightline
