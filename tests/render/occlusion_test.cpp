// SPDX-License-Identifier: Apache-2.0
// What the static scene hides: against a recording with known visibility, and its border under a
// trembling pose.
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "render/overlay/tile/tile_compositor.hpp"
#include "render/overlay_scene.hpp"
#include "render/render_support.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/geometry/mesh.hpp"
#include "sightline/image/image.hpp"
#include "sightline/record/pose_log.hpp"

namespace sightline {
namespace {

using PixelClass = TileCompositor::PixelClass;

/// Draws and classifies as CameraRenderer does with its default tolerance.
class Classifier {
 public:
  Classifier(std::shared_ptr<const RayTable> rays, std::shared_ptr<const StaticDepth> depth)
      : rays_(rays),
        depth_(std::move(depth)),
        rasterizer_(rays),
        compositor_(rays->width(), rays->height()) {}

  void classify(const RenderMesh& mesh, const Rigid3& camera_from_object, double sigma) {
    const RenderOptions options;
    const double depth = (camera_from_object * mesh.center.cast<double>()).z();
    rasterizer_.render(mesh, camera_from_object, TileCompositor::kMargin, tile_);
    compositor_.classify(
        tile_, depth_.get(),
        hide_factor(options.depth_tolerance, options.depth_tolerance_sigmas, sigma, depth));
  }
  /// Of the whole frame, row by row.
  std::vector<PixelClass> classes() const {
    std::vector<PixelClass> all;
    for (int y = 0; y < rays_->height(); ++y) {
      for (int x = 0; x < rays_->width(); ++x) all.push_back(compositor_.pixel_class(x, y));
    }
    return all;
  }

 private:
  std::shared_ptr<const RayTable> rays_;
  std::shared_ptr<const StaticDepth> depth_;
  MeshRasterizer rasterizer_;
  TileCompositor compositor_;
  RasterTile tile_;
};

size_t count(const std::vector<PixelClass>& classes, PixelClass wanted) {
  return static_cast<size_t>(std::ranges::count(classes, wanted));
}

struct Visibility {
  double visible = 0;
  double pixels = 0;
};

/// visibility.csv: camera,index,object,visible_fraction,xmin,ymin,xmax,ymax,inimage_pixels
std::vector<Visibility> visibility_of(const std::filesystem::path& file,
                                      const std::string& camera) {
  std::vector<Visibility> rows;
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream words(line);
    std::string name, index, object;
    double box[4];
    Visibility row;
    words >> name >> index >> object >> row.visible >> box[0] >> box[1] >> box[2] >> box[3] >>
        row.pixels;
    if (name == camera && words) rows.push_back(row);
  }
  return rows;
}

/// A monitor passes between the side camera and the carton: whole, cut by one edge, hidden, cut by
/// the other, whole. The recording was path-traced by a program that shares no code with this one.
TEST(Occlusion, TheSideCameraAgreesWithTheRecordingsVisibility) {
  const std::filesystem::path folder =
      std::filesystem::path(SIGHTLINE_SOURCE_DIR) / "recordings/bench";
  if (!std::filesystem::exists(folder / "visibility.csv"))
    GTEST_SKIP() << folder << " is not there";
  const auto cameras = read_calibration(folder / "calibration.toml");
  ASSERT_TRUE(cameras.has_value()) << cameras.error().message();
  const auto side = std::ranges::find(*cameras, "side", &CalibratedCamera::name);
  ASSERT_NE(side, cameras->end());
  const auto truth = read_truth(folder / "truth.csv");
  ASSERT_TRUE(truth.has_value());
  const std::vector<Visibility> known = visibility_of(folder / "visibility.csv", "side");
  ASSERT_EQ(known.size(), truth->size());
  const auto carton = read_mesh(folder / "objects/carton.obj");
  const auto scene = read_mesh(folder / "scene.obj");
  ASSERT_TRUE(carton.has_value() && scene.has_value());
  const RenderMesh mesh = make_render_mesh(*carton);
  const RenderMesh monitor = make_render_mesh(*scene);

  const auto rays = RayTable::build(side->model);
  const SceneMesh placed{&monitor, Rigid3()};
  Classifier classifier(rays, StaticDepth::build(rays, side->world_from_camera, {&placed, 1}));
  const Rigid3 camera_from_world = side->world_from_camera.inverse();
  double worst = 0;
  size_t whole = 0, cut = 0, gone = 0;
  for (size_t i = 0; i < known.size(); ++i) {
    classifier.classify(mesh, camera_from_world * (*truth)[i].world_from_object, 0.0005);
    const auto classes = classifier.classes();
    const auto hidden = static_cast<double>(count(classes, PixelClass::kHidden));
    const auto all = hidden + static_cast<double>(count(classes, PixelClass::kVisible));
    if (known[i].pixels < 1) continue;
    ASSERT_GT(all, 0) << "frame " << i;
    EXPECT_NEAR(all, known[i].pixels, 0.03 * known[i].pixels + 60) << "frame " << i;
    EXPECT_NEAR(hidden / all, 1 - known[i].visible, 0.05) << "frame " << i;
    worst = std::max(worst, std::abs(hidden / all - (1 - known[i].visible)));
    (known[i].visible > 0.99 ? whole : known[i].visible < 0.01 ? gone : cut) += 1;
  }
  std::printf("%zu frames whole, %zu cut, %zu hidden; hidden share off by at most %.1f points\n",
              whole, cut, gone, 100 * worst);
  EXPECT_GT(whole, 5u);
  EXPECT_GT(cut, 5u);
  EXPECT_GT(gone, 5u);
}

struct Stability {
  double mean = 0, worst = 0, hidden = 0;  ///< shares of the mask
};

/// Share of the mask's pixels that go from seen to hidden or back from frame to frame, with 1 mm of
/// noise in position along each axis and 0.1 degrees in rotation.
Stability tremble(const test::OverlayScene& scene, const RenderMesh& mesh, const Rigid3& pose) {
  constexpr double kSigma = 0.001;
  constexpr int kFrames = 60;
  test::Dice dice(77);
  const auto normal = [&] {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += dice.uniform(0, 1);
    return sum;
  };
  Classifier classifier(scene.rays, scene.depth);
  std::vector<PixelClass> before;
  Stability result;
  for (int i = 0; i < kFrames; ++i) {
    Rigid3 shaken = pose;
    shaken.translation += kSigma * Eigen::Vector3d(normal(), normal(), normal());
    const Eigen::Vector3d turn =
        0.1 * std::numbers::pi / 180 * Eigen::Vector3d(normal(), normal(), normal());
    shaken.rotation =
        shaken.rotation * Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
    classifier.classify(mesh, scene.camera.world_from_camera.inverse() * shaken, kSigma);
    const auto now = classifier.classes();
    const auto hidden = static_cast<double>(count(now, PixelClass::kHidden));
    const double mask = hidden + static_cast<double>(count(now, PixelClass::kVisible));
    if (i > 0) {
      size_t changed = 0;
      for (size_t k = 0; k < now.size(); ++k) {
        if (now[k] != before[k] && now[k] != PixelClass::kEmpty && before[k] != PixelClass::kEmpty)
          ++changed;
      }
      const double share = static_cast<double>(changed) / mask;
      result.mean += share / (kFrames - 1);
      result.worst = std::max(result.worst, share);
    }
    result.hidden += hidden / mask / kFrames;
    before = now;
  }
  return result;
}

void expect_stable(const char* what, const Stability& s, double max) {
  std::printf("%s: %.0f %% hidden; %.3f %% of the mask changes a frame, at most %.3f %%\n", what,
              100 * s.hidden, 100 * s.mean, 100 * s.worst);
  EXPECT_GT(s.hidden, 0.2);
  EXPECT_LT(s.hidden, 0.8);
  EXPECT_LT(s.mean, 0.01);
  EXPECT_LT(s.worst, max);
}

/// A wall's edge runs down the middle of the object, well before it.
TEST(Occlusion, TheBorderKeepsStillBehindAnEdge) {
  test::OverlayScene scene(1280, 720);
  scene.build_wall({-0.3, 0, 0.7}, {0.6f, 1.0f, 0.01f});
  expect_stable("behind an edge", tremble(scene, *scene.mesh, test::pose_at(0, 0, 1.0)), 0.01);
}

/// The object leans on the wall: part of it is before the wall, part
/// behind, so depths are all but equal along a line across its face.
TEST(Occlusion, TheBorderKeepsStillWhereItCutsAWall) {
  test::OverlayScene scene(1280, 720);
  scene.build_wall({0, 0, 1.0}, {2.0f, 2.0f, 0.002f});
  const Eigen::Quaterniond steep(Eigen::AngleAxisd(0.9, Eigen::Vector3d::UnitY()));
  // Here the border itself is where the trembling surfaces meet: it moves by about a pixel.
  expect_stable("cutting a wall", tremble(scene, *scene.mesh, Rigid3(steep, {0, 0, 1.03})), 0.03);
}

std::shared_ptr<const Image> overlay_of(const test::OverlayScene& scene, const FrameHints& hints) {
  const OverlayStyle style =
      test::only({"outline", "fill", "wireframe", "box3d", "axes", "circle", "label"});
  auto renderer = scene.try_renderer(style);
  EXPECT_TRUE(renderer.has_value());
  auto image = std::make_shared<Image>(320, 240);
  const PoseTrackPtr track =
      test::track_of({test::estimate_at(test::pose_at(0.02, 0.01, 0.8), TrackState::kTracking)});
  std::vector<PoseAt> poses;
  (*renderer)->draw(image->mutable_view(), time_from_ns(test::kCapture), {&track, 1}, poses, hints);
  return image;
}

bool same_luma(const Image& a, const Image& b) {
  for (int y = 0; y < a.height(); ++y) {
    if (!std::equal(a.view().y.row(y), a.view().y.row(y) + a.width(), b.view().y.row(y)))
      return false;
  }
  return true;
}

/// What was learned hides like a scene that was given, lines and marks included; and adds to it.
TEST(Occlusion, WhatWasLearnedHidesLikeTheScene) {
  OcclusionDepth learned;
  learned.width = 160;
  learned.height = 120;
  std::vector<float> given(320 * 240, 0.0f);
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 160; ++x) learned.inverse_depth.push_back(x >= 80 ? 2.0f : 0.0f);
  }
  for (size_t i = 0; i < given.size(); ++i) given[i] = i % 320 >= 160 ? 0.5f : 0.0f;
  test::OverlayScene scene;
  const auto bare = overlay_of(scene, {});
  const auto by_hint = overlay_of(scene, {&learned});
  scene.depth = StaticDepth::build(scene.rays, scene.camera.world_from_camera, {}, given);
  const auto by_scene = overlay_of(scene, {});
  EXPECT_FALSE(same_luma(*bare, *by_hint));
  EXPECT_TRUE(same_luma(*by_scene, *by_hint));
  EXPECT_TRUE(same_luma(*by_scene, *overlay_of(scene, {&learned})));
  const OcclusionDepth far_away{{}, 300, 300, 4, 4, std::vector<float>(16, 2.0f)};
  EXPECT_TRUE(same_luma(*by_scene, *overlay_of(scene, {&far_away})));
}

TEST(Occlusion, ToleranceGrowsWithTheUncertainty) {
  EXPECT_FLOAT_EQ(hide_factor(0.01, 2, 0, 1), 1.01f);
  EXPECT_FLOAT_EQ(hide_factor(0.01, 2, 0.005, 0.5), 1.03f);
  EXPECT_GT(hide_factor(0.01, 2, 0.01, 1), hide_factor(0.01, 2, 0.001, 1));
  EXPECT_TRUE(std::isfinite(hide_factor(0.01, 2, 0.01, 0)));
}

}  // namespace
}  // namespace sightline
