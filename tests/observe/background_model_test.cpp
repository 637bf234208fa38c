// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/scene/background_model.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "support/allocations.hpp"
#include "support/random.hpp"
#include "support/scene_shapes.hpp"

namespace sightline::test {
namespace {

using namespace std::chrono_literals;

constexpr int kWidth = 320, kHeight = 240;

CalibratedCamera camera() {
  CameraModel::Parameters lens;
  lens.width = kWidth;
  lens.height = kHeight;
  lens.fx = lens.fy = 300;
  lens.cx = 159.5;
  lens.cy = 119.5;
  return {"left", CameraModel::create(lens, "test").value(), Rigid3()};
}

// A stained room and a gray-green block in it, in a light.
struct Scene {
  double light = 1;
  uint64_t room = 1;
  int left = -1, size = 60;  ///< of the block; negative: it is not there
  int top = 80;
  int shadow_left = -1;  ///< of a shadow of its size
  double noise = 2;
};

FramePtr shoot(const Scene& scene, int index, FrameStatus status = FrameStatus::kGood) {
  auto image = std::make_shared<Image>(kWidth, kHeight);
  Random random(static_cast<uint64_t>(index) + 77);
  const MutableI420View view = image->mutable_view();
  const auto inside = [&](int left, int x, int y) {
    return left >= 0 && x >= left && x < left + scene.size && y >= scene.top &&
           y < scene.top + scene.size;
  };
  const auto level = [](double value) {
    return static_cast<uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
  };
  const double gain = std::pow(scene.light, 1 / 2.2);
  const double phase = 1.7 * static_cast<double>(scene.room);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      double luma = 70 + 35 * std::sin(0.11 * x + phase) * std::cos(0.07 * y + 2 * phase);
      if (inside(scene.left, x, y)) luma = 95;
      if (inside(scene.shadow_left, x, y)) luma *= 0.7;
      view.y.row(y)[x] = level(16 + gain * luma + scene.noise * random.normal());
      if (x % 2 != 0 || y % 2 != 0) continue;
      double u = 12 * std::sin(0.05 * x - phase), v = 10 * std::cos(0.09 * y + phase);
      if (inside(scene.left, x, y)) u = -18, v = -14;
      if (inside(scene.shadow_left, x, y)) u *= 0.7, v *= 0.7;
      view.u.row(y / 2)[x / 2] = level(128 + gain * u + 0.5 * scene.noise * random.normal());
      view.v.row(y / 2)[x / 2] = level(128 + gain * v + 0.5 * scene.noise * random.normal());
    }
  }
  FrameInfo info;
  info.camera = CameraId(0);
  info.sequence = static_cast<uint64_t>(index);
  info.status = status;
  info.width = kWidth;
  info.height = kHeight;
  info.capture = Time(1s) + index * 33ms;
  return Frame::decoded(info, std::move(image));
}

struct Overlap {
  double inside = 0, outside = 0;  ///< shares that are new
  double shadow = 0;               ///< share inside that is shadow
};

Overlap compare(const ForegroundMap& map, int left, const Scene& scene) {
  int in = 0, in_new = 0, in_shadow = 0, out = 0, out_new = 0;
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const bool is_new =
          map.row(y)[x] == ForegroundMap::kForeground || map.row(y)[x] == ForegroundMap::kShadow;
      const bool inside = 2 * x >= left && 2 * x < left + scene.size && 2 * y >= scene.top &&
                          2 * y < scene.top + scene.size;
      (inside ? in : out) += 1;
      (inside ? in_new : out_new) += is_new;
      in_shadow += inside && map.row(y)[x] == ForegroundMap::kShadow;
    }
  }
  return {static_cast<double>(in_new) / in, static_cast<double>(out_new) / out,
          static_cast<double>(in_shadow) / in};
}

class Background : public ::testing::Test {
 protected:
  void learn(const Scene& scene, int frames, std::span<const KnownObject> known = {}) {
    for (int i = 0; i < frames; ++i) model_->learn(*shoot(scene, next_++), known);
  }
  std::unique_ptr<BackgroundModel> model_ = BackgroundModel::create(camera()).value();
  ForegroundMap map_;
  int next_ = 0;
};

TEST_F(Background, SaysNothingBeforeItHasLearned) {
  EXPECT_FALSE(model_->ready());
  EXPECT_FALSE(model_->foreground(*shoot({}, 0), {}, map_));
  learn({}, 8);
  EXPECT_FALSE(model_->ready()) << "a quarter of a second";
  learn({}, 12);
  ASSERT_TRUE(model_->ready());
  ASSERT_TRUE(model_->foreground(*shoot({}, next_), {}, map_));
  EXPECT_EQ(map_.width, kWidth / 2);
  EXPECT_LT(map_.share, 0.002) << "of noise";
}

TEST_F(Background, SeesWhatComesIn) {
  learn({}, 25);
  const Scene with{.left = 120};
  ASSERT_TRUE(model_->foreground(*shoot(with, next_), {}, map_));
  const Overlap seen = compare(map_, 120, with);
  EXPECT_GT(seen.inside, 0.9);
  EXPECT_LT(seen.outside, 0.01);
}

TEST_F(Background, MoreLightIsNothingNew) {
  learn({}, 25);
  for (const double light : {0.5, 0.8, 1.5, 2.0}) {
    const Scene with{.light = light, .left = 40};
    ASSERT_TRUE(model_->foreground(*shoot(with, next_), {}, map_)) << light;
    const Overlap seen = compare(map_, 40, with);
    EXPECT_GT(seen.inside, 0.85) << light;
    EXPECT_LT(seen.outside, 0.02) << light;
  }
}

TEST_F(Background, AShadowIsToldFromAThing) {
  learn({}, 25);
  const Scene scene{.shadow_left = 200};
  ASSERT_TRUE(model_->foreground(*shoot(scene, next_), {}, map_));
  const Overlap seen = compare(map_, 200, scene);
  EXPECT_GT(seen.inside, 0.8);
  EXPECT_GT(seen.shadow, 0.8 * seen.inside);
}

TEST_F(Background, WhatLayThereAtTheStartLeavesAGhostThatFades) {
  learn({.left = 120}, 25);
  const Scene gone;
  ASSERT_TRUE(model_->foreground(*shoot(gone, next_), {}, map_));
  EXPECT_GT(compare(map_, 120, gone).inside, 0.8) << "the place that it left is new";
  learn(gone, 30);  // longer than it had been there
  ASSERT_TRUE(model_->foreground(*shoot(gone, next_), {}, map_));
  EXPECT_LT(compare(map_, 120, gone).inside, 0.05);
}

TEST_F(Background, WhatPassesByIsNotLearned) {
  for (int i = 0; i < 30; ++i) learn({.left = 8 * i}, 1);
  learn({}, 2);
  ASSERT_TRUE(model_->foreground(*shoot({}, next_), {}, map_));
  EXPECT_LT(map_.share, 0.02);
}

TEST_F(Background, AnotherSceneIsLearnedAnew) {
  learn({}, 25);
  const Scene other{.room = 2};
  EXPECT_FALSE(model_->foreground(*shoot(other, next_), {}, map_)) << "nearly all of it is new";
  EXPECT_TRUE(map_.classes.empty());
  learn(other, 4);
  EXPECT_FALSE(model_->ready());
  learn(other, 30);
  ASSERT_TRUE(model_->foreground(*shoot(other, next_), {}, map_));
  EXPECT_LT(map_.share, 0.02);
}

TEST_F(Background, AKnownObjectIsNeverLearned) {
  const TriangleMesh mesh = make_carton();
  ViewpointModelOptions options;
  options.subdivisions = 1;
  options.image_px = 120;
  const auto render_mesh = std::make_shared<const RenderMesh>(make_render_mesh(mesh));
  const auto views =
      ViewpointModel::build(mesh, mesh_depth_renderer_factory(render_mesh), options).value();
  const KnownObject known{views.get(), Rigid3(Eigen::Quaterniond::Identity(), {0, 0, 0.6})};
  const std::span<const KnownObject> all(&known, 1);
  const Scene with{.left = 130, .size = 50, .top = 95};  // within the carton's 55 x 35 px
  for (int seconds = 0; seconds < 2; ++seconds) learn(with, 30, all);
  ASSERT_TRUE(model_->ready());
  ASSERT_TRUE(model_->foreground(*shoot(with, next_), all, map_));
  EXPECT_EQ(map_.row(kHeight / 4)[kWidth / 4], ForegroundMap::kUnknown);
  EXPECT_EQ(map_.row(10)[10], ForegroundMap::kBackground);
  // Gone: what was behind it was never seen, which is no foreground.
  ASSERT_TRUE(model_->foreground(*shoot({}, next_), {}, map_));
  EXPECT_EQ(map_.row(kHeight / 4)[kWidth / 4], ForegroundMap::kUnknown);
}

TEST_F(Background, IgnoresWhatItCannotUse) {
  learn({}, 25);
  model_->learn(*shoot({.room = 3}, next_, FrameStatus::kDamaged), {});
  FrameInfo small = shoot({}, next_)->info();
  small.width = small.height = 64;
  const FramePtr other = Frame::decoded(small, std::make_shared<Image>(64, 64));
  model_->learn(*other, {});
  EXPECT_FALSE(model_->foreground(*other, {}, map_));
  EXPECT_TRUE(model_->foreground(*shoot({}, next_), {}, map_));
  EXPECT_FALSE(model_->wants(Time(1s) + (next_ - 1) * 33ms + 5ms)) << "too soon";
}

TEST_F(Background, AllocatesNothingPerFrame) {
  learn({}, 25);
  std::vector<FramePtr> frames;
  for (int i = 0; i < 4; ++i) {
    frames.push_back(shoot({.left = 100}, next_++));
    frames.back()->half_gray();
  }
  model_->foreground(*frames[0], {}, map_);
  const size_t before = allocations();
  for (const FramePtr& frame : frames) {
    model_->learn(*frame, {});
    model_->foreground(*frame, {}, map_);
  }
  EXPECT_EQ(allocations(), before);
}

TEST(BackgroundModel, RefusesTimesThatMakeNoSense) {
  EXPECT_FALSE(BackgroundModel::create(camera(), {.learn = 0s}));
  EXPECT_FALSE(BackgroundModel::create(camera(), {.absorb = -1s}));
}

}  // namespace
}  // namespace sightline::test
