// SPDX-License-Identifier: Apache-2.0
// Noise of cameras: how much there is, and what a search sees of it.
#include "observe/terms/noise.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "observe/detect/pixels/half_size_frame.hpp"
#include "sightline/image/image.hpp"
#include "sightline/observe/detect/object_detector.hpp"
#include "support/allocations.hpp"
#include "support/lens_camera.hpp"
#include "support/random.hpp"
#include "support/scene_shapes.hpp"
#include "support/search_scene.hpp"

namespace sightline::observe {
namespace {

constexpr int kWidth = 320, kHeight = 240;

struct Plane {
  std::vector<uint8_t> levels = std::vector<uint8_t>(size_t{kWidth} * kHeight, 128);

  uint8_t& at(int x, int y) { return levels[static_cast<size_t>(y * kWidth + x)]; }
  PlaneView view() const { return {levels.data(), kWidth, kHeight, kWidth}; }
  MutablePlaneView change() { return {levels.data(), kWidth, kHeight, kWidth}; }
  void add_noise(double sigma) {
    test::Random random(5);
    for (uint8_t& level : levels)
      level =
          static_cast<uint8_t>(std::clamp(std::lround(level + sigma * random.normal()), 0L, 255L));
  }
  double deviation() const {
    double sum = 0, squares = 0;
    for (const uint8_t level : levels) {
      sum += level;
      squares += level * level;
    }
    const double mean = sum / static_cast<double>(levels.size());
    return std::sqrt(squares / static_cast<double>(levels.size()) - mean * mean);
  }
};

/// Squares of 12 pixels, light and dark in turn, on a ramp.
Plane chessboard() {
  Plane plane;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x)
      plane.at(x, y) = static_cast<uint8_t>(60 + x / 4 + ((x / 12 + y / 12) % 2 == 0 ? 80 : 0));
  }
  return plane;
}

TEST(NoiseLevel, IsTheDeviationOfTheNoiseWhateverTheImageShows) {
  EXPECT_LT(noise_level(chessboard().view()), 0.3);
  for (const double sigma : {1.0, 2.0, 4.0, 8.0, 15.0}) {
    Plane flat, board = chessboard();
    flat.add_noise(sigma);
    board.add_noise(sigma);
    EXPECT_NEAR(noise_level(flat.view()), sigma, 0.1 * sigma);
    EXPECT_NEAR(noise_level(board.view()), sigma, 0.25 * sigma) << "a third of it at edges";
  }
}

TEST(NoiseLevel, OfAnImageOfFewPixelsIsZero) {
  const std::vector<uint8_t> levels = {1, 200, 7, 90};
  EXPECT_EQ(noise_level({levels.data(), 2, 2, 2}), 0);
}

TEST(BinomialFilter, HasBinomialWeights) {
  Plane plane;
  std::fill(plane.levels.begin(), plane.levels.end(), uint8_t{0});
  plane.at(100, 50) = 160;
  plane.at(0, 0) = 160;
  BinomialFilter().smooth(plane.change(), 1);
  EXPECT_EQ(plane.at(100, 50), 40);
  EXPECT_EQ(plane.at(101, 50), 20);
  EXPECT_EQ(plane.at(100, 49), 20);
  EXPECT_EQ(plane.at(99, 51), 10);
  EXPECT_EQ(plane.at(98, 50), 0);
  EXPECT_EQ(plane.at(0, 0), 90) << "the border goes on beyond it";
}

TEST(BinomialFilter, LeavesOfNoiseAndOfAStepWhatItSays) {
  const double left[] = {1, 0.375, 0.273, 0.226, 0.196, 0.176, 0.161};
  for (int passes = 0; passes <= Smoothing::kMost; ++passes) {
    Plane noisy, step;
    noisy.add_noise(20);
    const double before = noisy.deviation();
    BinomialFilter().smooth(noisy.change(), passes);
    EXPECT_NEAR(noisy.deviation() / before, left[passes], 0.02) << passes;
    for (int y = 0; y < kHeight; ++y) std::fill_n(&step.at(kWidth / 2, y), kWidth / 2, uint8_t{0});
    BinomialFilter().smooth(step.change(), passes);
    int steepest = 0;
    for (int x = 1; x < kWidth - 1; ++x)
      steepest = std::max(steepest, std::abs(step.at(x + 1, 9) - step.at(x - 1, 9)));
    EXPECT_NEAR(steepest / 128.0, BinomialFilter::sharpness(passes), 0.02) << passes;
  }
}

TEST(Smoothing, IsAsStrongAsTheNoiseAsksFor) {
  const auto passes_of = [](double sigma) {
    Plane plane = chessboard();
    plane.add_noise(sigma);
    return Smoothing().update(plane.view());
  };
  EXPECT_EQ(passes_of(0), 0);
  EXPECT_EQ(passes_of(1.5), 0);
  EXPECT_EQ(passes_of(4), 1);
  EXPECT_EQ(passes_of(7), 2);
  EXPECT_EQ(passes_of(40), Smoothing::kMost);
}

TEST(Smoothing, StaysWhileTheNoiseDoes) {
  Smoothing smoothing;
  const auto update = [&](double sigma) {
    Plane plane;
    plane.add_noise(sigma);
    return smoothing.update(plane.view());
  };
  EXPECT_EQ(update(2.2), 0);
  EXPECT_EQ(update(2.9), 1);
  for (const double sigma : {2.2, 2.9, 2.3}) EXPECT_EQ(update(sigma), 1) << sigma;
  EXPECT_EQ(update(1.5), 0);
}

FramePtr noisy_frame(double sigma) {
  const auto image = std::make_shared<Image>(2 * kWidth, 2 * kHeight);
  test::Random random(5);
  const auto level = [&] {
    return static_cast<uint8_t>(std::lround(128 + sigma * random.normal()));
  };
  const MutableI420View to = image->mutable_view();
  for (const MutablePlaneView& plane : {to.y, to.u, to.v}) {
    for (int y = 0; y < plane.height; ++y) std::generate_n(plane.row(y), plane.width, level);
  }
  FrameInfo info;
  info.width = 2 * kWidth;
  info.height = 2 * kHeight;
  return Frame::decoded(info, image);
}

TEST(HalfSizeFrame, IsSmoothedWhereItIsNoisy) {
  const CameraModel camera = test::lens_camera().model;
  HalfSizeFrame clean, noisy;
  clean.store(*noisy_frame(1), camera, 1, true);
  EXPECT_EQ(clean.image.sharpness, 1);
  const FramePtr frame = noisy_frame(12);
  noisy.store(*frame, camera, 1, true);
  EXPECT_LT(noisy.image.sharpness, 1);
  for (size_t plane = 0; plane < 3; ++plane)
    EXPECT_LT(noise_level(noisy.image.view(plane)), 2.5) << plane;
  EXPECT_LT(noise_level({noisy.full_luma.data(), noisy.width, noisy.height, noisy.width}), 2.5);
  HalfSizeImage quarter;
  reduce(noisy.image, quarter);
  EXPECT_GT(quarter.sharpness, noisy.image.sharpness);
  const size_t before = test::allocations();
  noisy.store(*frame, camera, 1, true);
  EXPECT_EQ(test::allocations(), before);
}

// As a camera's sensor gives it: every channel of every pixel for itself.
TEST(NoisyRoom, WhatLiesThereIsFound) {
  const TriangleMesh mesh = test::make_truck();
  const auto views = test::views_of(mesh);
  DetectorOptions range;
  range.nearest = 0.55;
  range.farthest = 0.9;
  int right = 0;
  constexpr int kPoses = 6;
  for (int i = 0; i < kPoses; ++i) {
    const Rigid3 pose = test::turned(0.8 + i, {1, 2.0 - i, 3}, {0.03, -0.02, 0.01});
    test::SceneRigOptions options = test::search_scene(mesh, test::resting(pose));
    options.sensor.read_noise = 20;
    const test::SceneRig rig(options);
    const auto detector =
        ObjectDetector::create(ObjectId(0), views, test::detector_cameras(rig), range).value();
    test::add_first_frames(
        rig, [&](CameraId id, const Frame& frame) { detector->add_frame(id, frame); });
    const Detection found = detector->detect();
    if (found.poses.empty()) continue;
    const Rigid3& there = found.poses.front().world_from_object;
    right += translation_distance(there, pose) < 0.02 && rotation_angle(there, pose) < 0.1 ? 1 : 0;
  }
  EXPECT_GE(right, kPoses - 1);
}

}  // namespace
}  // namespace sightline::observe
