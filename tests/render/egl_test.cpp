// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include "render/gpu/egl_device.hpp"
#include "render/overlay_scene.hpp"
#include "render/random_scenes.hpp"
#include "render/test_images.hpp"
#include "sightline/render/gpu/raster_device.hpp"
#include "sightline/render/raster/surface_shader.hpp"

namespace sightline {
namespace {

using test::Dice;

std::shared_ptr<EglDevice> device() {
  static const auto opened = EglDevice::open();
  return opened ? *opened : nullptr;
}

/// 100 frames; SIGHTLINE_AGREEMENT_FRAMES=1000 for the full count of the acceptance.
int frames_wanted() {
  const char* text = std::getenv("SIGHTLINE_AGREEMENT_FRAMES");
  return text == nullptr ? 100 : std::max(1, std::atoi(text));
}

struct Difference {
  size_t covered = 0, mask = 0, depth = 0, shade = 0;
  double worst_depth = 0;
};

Difference difference(const RasterTile& a, const RasterTile& b) {
  Difference d;
  for (int y = 0; y < a.height(); ++y) {
    for (int x = 0; x < a.width(); ++x) {
      const auto p = double{a.inverse_depth(y)[x]};
      const auto q = double{b.inverse_depth(y)[x]};
      if (p > 0) ++d.covered;
      if ((p > 0) != (q > 0)) {
        ++d.mask;
      } else if (p > 0) {
        const double off = std::abs(p - q) / p;
        d.worst_depth = std::max(d.worst_depth, off);
        if (off > 1e-4) ++d.depth;
        if (std::abs(int{a.shade(y)[x]} - int{b.shade(y)[x]}) > 1) ++d.shade;
      }
    }
  }
  return d;
}

#define NEED_EGL() \
  if (device() == nullptr) GTEST_SKIP() << EglDevice::open().error().message()

TEST(EglAgreement, RandomPosesMeshesAndLenses) {
  NEED_EGL();
  const int frames = frames_wanted();
  constexpr int kPerLens = 20;
  Dice dice(4711);
  Difference sum;
  size_t worst_mask = 0, worst_inner = 0, wrong_frames = 0;
  RasterTile cpu_tile, gpu_tile;
  std::vector<RenderMesh> meshes;
  std::unique_ptr<MeshRasterizer> cpu;
  std::unique_ptr<RasterBackend> gpu;
  for (int i = 0; i < frames; ++i) {
    if (i % kPerLens == 0) {
      const auto rays = RayTable::build(test::random_lens(dice));
      cpu = std::make_unique<MeshRasterizer>(rays);
      gpu = device()->make_rasterizer(rays);
      meshes = test::random_meshes(dice);
    }
    const RenderMesh& mesh = meshes[static_cast<size_t>(i) % meshes.size()];
    const Rigid3 pose = test::random_pose(dice, cpu->rays().model(), mesh);
    const TileRect rect = cpu->bounds(mesh, pose, 4);
    EXPECT_EQ(rect, gpu->bounds(mesh, pose, 4));
    cpu_tile.reset(rect);
    gpu_tile.reset(rect);
    ASSERT_TRUE(cpu->draw(mesh, pose, cpu_tile).has_value());
    const Status drawn = gpu->draw(mesh, pose, gpu_tile);
    ASSERT_TRUE(drawn.has_value()) << drawn.error().message();
    const Difference d = difference(cpu_tile, gpu_tile);
    EXPECT_LE(d.mask, 3u) << "frame " << i << ", tile " << rect.width << "x" << rect.height;
    // Where surfaces cut one another a pixel may take either; they are few. Slivers beside the
    // camera know their depth less well.
    EXPECT_LE(d.depth + d.shade, 20 + d.covered / 5000) << "frame " << i;
    EXPECT_LT(d.worst_depth, 0.1) << "frame " << i;
    sum.covered += d.covered;
    sum.mask += d.mask;
    sum.depth += d.depth;
    sum.shade += d.shade;
    sum.worst_depth = std::max(sum.worst_depth, d.worst_depth);
    worst_mask = std::max(worst_mask, d.mask);
    worst_inner = std::max(worst_inner, d.depth + d.shade);
    wrong_frames += d.mask > 0 ? 1 : 0;
  }
  std::printf(
      "%d frames on %s: %zu covered pixels; mask: %zu differ in %zu frames, at most %zu in one; "
      "1/z by more than 1e-4: %zu, at most %.1e; shade by more than 1: %zu; at most %zu of these "
      "in "
      "one frame\n",
      frames, device()->renderer().c_str(), sum.covered, sum.mask, wrong_frames, worst_mask,
      sum.depth, sum.worst_depth, sum.shade, worst_inner);
  EXPECT_GT(sum.covered, static_cast<size_t>(frames) * 5000);
}

/// Faces numbered by either, then shaded smoothly: the same image.
TEST(EglAgreement, SmoothShadingAndTextures) {
  NEED_EGL();
  const int frames = frames_wanted();
  Dice dice(815);
  size_t covered = 0, mask = 0, worst_mask = 0, shade = 0, luma = 0, worst = 0;
  std::vector<RenderMesh> meshes;
  std::shared_ptr<const RayTable> rays;
  std::unique_ptr<MeshRasterizer> cpu;
  std::unique_ptr<RasterBackend> gpu;
  for (int i = 0; i < frames; ++i) {
    if (i % 20 == 0) {
      rays = RayTable::build(test::random_lens(dice));
      cpu = std::make_unique<MeshRasterizer>(rays);
      gpu = device()->make_rasterizer(rays);
      meshes = test::random_meshes(dice);
      for (RenderMesh& mesh : meshes) test::paint_with_noise(dice, mesh);
    }
    const RenderMesh& mesh = meshes[static_cast<size_t>(i) % meshes.size()];
    const Rigid3 pose = test::random_pose(dice, rays->model(), mesh);
    RasterTile tiles[2];
    SurfaceShader shaders[2] = {SurfaceShader(rays), SurfaceShader(rays)};
    for (size_t k = 0; k < 2; ++k) {
      RasterBackend& backend = k == 0 ? static_cast<RasterBackend&>(*cpu) : *gpu;
      tiles[k].reset(cpu->bounds(mesh, pose, 4), true);
      ASSERT_TRUE(backend.draw(mesh, pose, tiles[k]).has_value());
      shaders[k].run(mesh, pose, Shading::kSmooth, true, tiles[k]);
    }
    size_t mask_here = 0, shade_here = 0, covered_here = 0;
    for (int y = 0; y < tiles[0].height(); ++y) {
      for (int x = 0; x < tiles[0].width(); ++x) {
        const bool a = tiles[0].face(y)[x] != RasterTile::kNoFace;
        const bool b = tiles[1].face(y)[x] != RasterTile::kNoFace;
        if (a) ++covered_here;
        if (a != b) ++mask_here;
        if (!a || !b) continue;
        if (std::abs(tiles[0].shade(y)[x] - tiles[1].shade(y)[x]) > 1) ++shade_here;
        if (std::abs(shaders[0].luma(y)[x] - shaders[1].luma(y)[x]) > 1) ++luma;
      }
    }
    EXPECT_LE(mask_here, 3u) << "frame " << i;
    EXPECT_LE(shade_here, 20 + covered_here / 5000) << "frame " << i;
    covered += covered_here;
    mask += mask_here;
    worst_mask = std::max(worst_mask, mask_here);
    shade += shade_here;
    worst = std::max(worst, shade_here);
  }
  std::printf(
      "%d frames, smooth and textured: %zu covered pixels; mask: %zu differ, at most %zu in one; "
      "shade by more than 1: %zu, at most %zu in one; luma of the texture: %zu\n",
      frames, covered, mask, worst_mask, shade, worst, luma);
  EXPECT_LE(luma, covered / 5000 + 20);
  EXPECT_GT(covered, static_cast<size_t>(frames) * 5000);
}

/// Draws a box in the middle of a small camera's image.
struct SmallScene {
  std::shared_ptr<const RayTable> rays = RayTable::build(test::camera(test::lens_rational()));
  RenderMesh mesh = make_render_mesh(make_box({0.2f, 0.15f, 0.1f}));
  Rigid3 pose{Eigen::Quaterniond(0.9, 0.3, 0.2, 0.1).normalized(), {0.02, 0.01, 0.8}};
  RasterTile tile;

  Status draw(RasterBackend& backend) {
    tile.reset(backend.bounds(mesh, pose, 4));
    return backend.draw(mesh, pose, tile);
  }
  size_t covered() const {
    size_t count = 0;
    for (int y = 0; y < tile.height(); ++y) {
      for (int x = 0; x < tile.width(); ++x) count += tile.inverse_depth(y)[x] > 0 ? 1u : 0u;
    }
    return count;
  }
};

TEST(EglRasterizer, DrawsOnTopOfWhatIsThere) {
  NEED_EGL();
  SmallScene scene;
  const auto gpu = device()->make_rasterizer(scene.rays);
  ASSERT_TRUE(scene.draw(*gpu).has_value());
  const float there = scene.tile.inverse_depth(40)[40];
  scene.tile.inverse_depth(40)[40] = 100;
  scene.tile.shade(40)[40] = 7;
  ASSERT_TRUE(gpu->draw(scene.mesh, scene.pose, scene.tile).has_value());
  EXPECT_GT(there, 0);
  EXPECT_EQ(scene.tile.inverse_depth(40)[40], 100);
  EXPECT_EQ(scene.tile.shade(40)[40], 7);
}

TEST(EglRasterizer, SurvivesALostContext) {
  NEED_EGL();
  const auto own = EglDevice::open();
  ASSERT_TRUE(own.has_value());
  SmallScene scene;
  const auto first = (*own)->make_rasterizer(scene.rays);
  const auto second = (*own)->make_rasterizer(scene.rays);
  ASSERT_TRUE(scene.draw(*first).has_value());
  ASSERT_TRUE(scene.draw(*second).has_value());
  const size_t before = scene.covered();
  ASSERT_GT(before, 1000u);
  (*own)->lose_contexts();
  for (RasterBackend* each : {first.get(), second.get(), first.get()}) {
    ASSERT_TRUE(scene.draw(*each).has_value());
    EXPECT_EQ(scene.covered(), before);
  }
  EXPECT_EQ((*own)->losses(), 1);
}

TEST(EglRasterizer, GivesUpAfterTheThirdLoss) {
  NEED_EGL();
  const auto own = EglDevice::open();
  ASSERT_TRUE(own.has_value());
  SmallScene scene;
  const auto gpu = (*own)->make_rasterizer(scene.rays);
  for (int i = 0; i < EglDevice::kMaxLosses; ++i) {
    ASSERT_TRUE(scene.draw(*gpu).has_value());
    (*own)->lose_contexts();
  }
  const Status refused = scene.draw(*gpu);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(scene.covered(), 0u);
}

/// What a camera's worker holds: after the third loss it goes on with the CPU.
TEST(RasterDevice, FallsBackToTheCpu) {
  NEED_EGL();
  const auto own = EglDevice::open();
  ASSERT_TRUE(own.has_value());
  SmallScene scene;
  const auto backend = guard_rasterizer((*own)->make_rasterizer(scene.rays), scene.rays);
  ASSERT_TRUE(scene.draw(*backend).has_value());
  const size_t covered = scene.covered();
  for (int i = 0; i < EglDevice::kMaxLosses; ++i) {
    EXPECT_EQ(backend->name(), "egl");
    (*own)->lose_contexts();
    ASSERT_TRUE(scene.draw(*backend).has_value());
    EXPECT_EQ(scene.covered(), covered);
  }
  EXPECT_EQ(backend->name(), "cpu");
}

TEST(RasterDevice, EveryChoiceDrawsOrSaysWhyNot) {
  SmallScene scene;
  size_t covered = 0;
  for (const RasterChoice choice : {RasterChoice::kCpu, RasterChoice::kAuto, RasterChoice::kEgl}) {
    const auto opened = RasterDevice::open(choice);
    if (!opened) {
      ASSERT_EQ(choice, RasterChoice::kEgl);
      EXPECT_EQ(opened.error().code, ErrorCode::kUnavailable);
      EXPECT_NE(opened.error().text.find("choose \"cpu\""), std::string::npos);
      continue;
    }
    const auto backend = (*opened)->make_backend(scene.rays);
    ASSERT_TRUE(scene.draw(*backend).has_value());
    if (covered == 0) covered = scene.covered();
    EXPECT_EQ(scene.covered(), covered) << (*opened)->description();
    if (choice == RasterChoice::kCpu) {
      EXPECT_EQ((*opened)->description(), "cpu");
    }
  }
}

/// Several cameras at once: contexts of one share group, one mesh, a thread each.
TEST(EglRasterizer, CamerasDrawAtTheSameTime) {
  NEED_EGL();
  constexpr int kCameras = 4;
  std::array<SmallScene, kCameras> scenes;
  const RenderMesh shared = make_render_mesh(make_bumpy_torus(2000, 0.1f));
  std::array<size_t, kCameras> covered{};
  std::vector<std::unique_ptr<RasterBackend>> backends;
  for (const SmallScene& scene : scenes) backends.push_back(device()->make_rasterizer(scene.rays));
  std::vector<std::thread> threads;
  for (size_t i = 0; i < kCameras; ++i) {
    threads.emplace_back([&, i] {
      for (int frame = 0; frame < 10; ++frame) {
        scenes[i].tile.reset(backends[i]->bounds(shared, scenes[i].pose, 4));
        if (!backends[i]->draw(shared, scenes[i].pose, scenes[i].tile).has_value()) return;
        covered[i] = scenes[i].covered();
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_GT(covered[0], 1000u);
  for (const size_t each : covered) EXPECT_EQ(each, covered[0]);
}

/// The whole overlay, half behind a wall, with either backend: the same image.
TEST(CameraRendererOnEgl, DrawsTheSameImage) {
  NEED_EGL();
  test::OverlayScene scene;
  scene.build_wall({-0.3, 0, 0.5}, {0.6f, 1.0f, 0.01f});
  OverlayStyle style = test::only({"outline", "fill", "wireframe", "box2d", "box3d"});
  const PoseTrackPtr track =
      test::track_of({test::estimate_at(test::pose_at(0, 0, 0.9), TrackState::kTracking)});
  std::vector<std::unique_ptr<test::GrayImage>> images;
  for (const RasterChoice choice : {RasterChoice::kCpu, RasterChoice::kEgl}) {
    RenderOptions options;
    options.backend = choice;
    auto renderer = scene.try_renderer(style, options);
    ASSERT_TRUE(renderer.has_value()) << renderer.error().message();
    images.push_back(std::make_unique<test::GrayImage>(320, 240, 128));
    std::vector<PoseAt> poses;
    (*renderer)->draw(images.back()->mutable_view(), time_from_ns(test::kCapture),
                      std::span(&track, 1), poses);
  }
  EXPECT_GT(test::differing_luma(images[0]->view(), 128).size(), 2000u);
  size_t differing = 0;
  test::for_each_luma(images[0]->view(), [&](int x, int y, int luma) {
    if (std::abs(luma - int{images[1]->view().y.row(y)[x]}) > 1) ++differing;
  });
  // One mask pixel changes the outline's filter over seven by seven.
  EXPECT_LE(differing, 49u);
}

TEST(EglNames, ExtensionsAreWholeWords) {
  const char* list = "EGL_KHR_fence_sync EGL_EXT_image_dma_buf_import_modifiers EGL_KHR_image";
  EXPECT_TRUE(has_extension(list, "EGL_KHR_fence_sync"));
  EXPECT_TRUE(has_extension(list, "EGL_KHR_image"));
  EXPECT_FALSE(has_extension(list, "EGL_EXT_image_dma_buf_import"));
  EXPECT_FALSE(has_extension(list, "EGL_KHR"));
  EXPECT_FALSE(has_extension(list, ""));
  EXPECT_FALSE(has_extension(nullptr, "EGL_KHR_image"));
}

TEST(EglNames, SoftwareIsKnownByName) {
  EXPECT_TRUE(is_software_renderer("llvmpipe (LLVM 15.0.6, 256 bits)"));
  EXPECT_TRUE(is_software_renderer("softpipe"));
  EXPECT_TRUE(is_software_renderer("Google SwiftShader"));
  EXPECT_FALSE(is_software_renderer("Mesa Intel(R) UHD Graphics 630 (CFL GT2)"));
  EXPECT_FALSE(is_software_renderer("NVIDIA H200/PCIe/SSE2"));
}

}  // namespace
}  // namespace sightline
