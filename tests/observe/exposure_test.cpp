// SPDX-License-Identifier: Apache-2.0
#include "observe/terms/exposure.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>

#include "dimmed_frame.hpp"
#include "observe/detect/pixels/half_size_frame.hpp"
#include "observe/track/exposed_frames.hpp"
#include "support/allocations.hpp"
#include "support/lens_camera.hpp"

namespace sightline::observe {
namespace {

using namespace std::chrono_literals;
using test::dimmed;

constexpr int kWidth = 640, kHeight = 480;

/// All levels from black to white from the left to the right, colors from the top to the bottom.
FramePtr bright_frame(Time capture = Time{}) {
  const auto image = std::make_shared<Image>(kWidth, kHeight);
  const MutableI420View to = image->mutable_view();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x)
      to.y.row(y)[x] = static_cast<uint8_t>(16 + 219 * x / (kWidth - 1));
  }
  for (int y = 0; y < kHeight / 2; ++y) {
    for (int x = 0; x < kWidth / 2; ++x) {
      to.u.row(y)[x] = static_cast<uint8_t>(98 + y / 4);
      to.v.row(y)[x] = static_cast<uint8_t>(158 - y / 4);
    }
  }
  FrameInfo info;
  info.width = kWidth;
  info.height = kHeight;
  info.capture = capture;
  return Frame::decoded(info, image);
}

double gain_of(const Frame& frame) { return ExposureGain().update(frame.gray()); }

int largest_difference(const PlaneView& a, const PlaneView& b) {
  int most = 0;
  for (int y = 0; y < a.height; ++y) {
    for (int x = 0; x < a.width; ++x) most = std::max(most, std::abs(a.row(y)[x] - b.row(y)[x]));
  }
  return most;
}

TEST(Exposure, WhatIsBrightStaysAsItIs) {
  EXPECT_EQ(gain_of(*bright_frame()), 1);
  EXPECT_EQ(gain_of(*dimmed(bright_frame(), 0.6)), 1);
}

TEST(Exposure, WhatIsDarkIsExposedLongerButNotWithoutEnd) {
  // 5 % of a ramp are above 95 % of it.
  for (const double share : {0.5, 0.4, 0.25}) {
    EXPECT_NEAR(gain_of(*dimmed(bright_frame(), share)), 189 / (0.95 * 219 * share), 0.06) << share;
  }
  EXPECT_EQ(gain_of(*dimmed(bright_frame(), 0.05)), 4);
  EXPECT_EQ(gain_of(*dimmed(bright_frame(), 0)), 4);
}

// Vectors and what is left of a row, at any width.
TEST(Exposure, EveryPixelIsMultiplied) {
  for (const int width : {1, 7, 16, 31, 160, 255}) {
    for (const double gain : {1.0, 1.09375, 2.5, 4.0}) {
      const auto image = std::make_shared<Image>(width, 3);
      const MutablePlaneView plane = image->mutable_view().y;
      const auto level = [&](int x, int y) { return (x * 255 / std::max(1, width - 1) + y) % 256; };
      for (int y = 0; y < 3; ++y)
        for (int x = 0; x < width; ++x) plane.row(y)[x] = static_cast<uint8_t>(level(x, y));
      const auto expect = [&](int zero) {
        for (int y = 0; y < 3; ++y) {
          for (int x = 0; x < width; ++x) {
            const double wanted = std::clamp(zero + gain * (level(x, y) - zero), 0.0, 255.0);
            ASSERT_NEAR(plane.row(y)[x], wanted, 1) << level(x, y) << " x " << gain;
            plane.row(y)[x] = static_cast<uint8_t>(level(x, y));
          }
        }
      };
      expose_luma(gain, image->view().y, plane);
      expect(16);
      expose_color(gain, image->view().y, plane);
      expect(128);
    }
  }
}

TEST(Exposure, ALampIsNoLight) {
  const double without = gain_of(*dimmed(bright_frame(), 0.4));
  FramePtr frame = dimmed(bright_frame(), 0.4);
  const auto image = std::make_shared<Image>(kWidth, kHeight);
  frame->copy_i420_to(image->mutable_view());
  for (int y = 0; y < kHeight / 30; ++y)  // 3 % of the image
    std::fill_n(image->mutable_view().y.row(y), kWidth, uint8_t{255});
  frame = Frame::decoded(frame->info(), image);
  EXPECT_GT(gain_of(*frame), 0.9 * without);
}

TEST(Exposure, ASearchSeesADimRoomAsABrightOne) {
  const CameraModel camera = test::lens_camera().model;
  HalfSizeFrame bright, dim;
  bright.store(*bright_frame(), camera, 1, true);
  const double share = 0.35, gain = 189 / (0.95 * 219 * share);
  dim.store(*dimmed(bright_frame(), share), camera, 1, true);
  bright.expose(gain * share);
  ASSERT_TRUE(dim.valid && bright.valid);
  EXPECT_TRUE(dim.image.in_color);
  // A level of the dim image is three of the bright one, and a gain is in steps of 1/32.
  for (size_t plane = 0; plane < 3; ++plane)
    EXPECT_LE(largest_difference(dim.image.view(plane), bright.image.view(plane)), 7) << plane;
  const PlaneView full = {dim.full_luma.data(), kWidth, kHeight, kWidth};
  EXPECT_LE(largest_difference(full, {bright.full_luma.data(), kWidth, kHeight, kWidth}), 7);
}

TEST(ExposedFrames, ABrightFrameIsTheFrameItself) {
  ExposedFrames frames(kWidth, kHeight);
  const FramePtr frame = bright_frame();
  EXPECT_EQ(&frames.show(*frame), frame.get());
  EXPECT_EQ(frames.show_like(frame), frame);
}

TEST(ExposedFrames, ADimOneIsShownAsItWouldBeInMoreLight) {
  ExposedFrames frames(kWidth, kHeight);
  const FramePtr dim = dimmed(bright_frame(Time(5s)), 0.35);
  const Frame& shown = frames.show(*dim);
  EXPECT_EQ(shown.info().capture, Time(5s));
  EXPECT_EQ(gain_of(shown), 1);
  EXPECT_EQ(largest_difference(frames.show_like(dim)->i420().u, shown.i420().u), 0);
}

TEST(ExposedFrames, ColorsStayTrueWhileTheLightDoes) {
  ExposedFrames frames(kWidth, kHeight);
  const auto luma_of = [&](double share) {
    return int{frames.show(*dimmed(bright_frame(), share)).gray().row(kHeight / 2)[kWidth / 2]};
  };
  const int first = luma_of(0.40);
  // The same pixel of a lamp that flickers by a tenth shows that, and nothing else.
  EXPECT_NEAR(luma_of(0.44) - 16, 1.1 * (first - 16), 4);
  EXPECT_NEAR(luma_of(0.37) - 16, 0.925 * (first - 16), 4);
  EXPECT_NEAR(luma_of(0.25), first, 8) << "another light";
  EXPECT_NEAR(luma_of(0.40), first, 8);
  EXPECT_NEAR(luma_of(1.0), 126, 1);
}

TEST(ExposedFrames, AtTheLimitOfDarknessTheyStayAsTheyAre) {
  ExposedFrames frames(kWidth, kHeight);
  const auto bright = [&](double share) {  // as it is, or made brighter?
    const FramePtr frame = dimmed(bright_frame(), share);
    return &frames.show(*frame) == frame.get();
  };
  EXPECT_TRUE(bright(0.56));
  EXPECT_FALSE(bright(0.53)) << "a twentieth is darker than 130";
  for (const double share : {0.57, 0.53, 0.58, 0.54}) EXPECT_FALSE(bright(share)) << share;
  EXPECT_TRUE(bright(0.72));
  EXPECT_TRUE(bright(0.57));
}

TEST(ExposedFrames, AllocateNothingOnceWarm) {
  ExposedFrames frames(kWidth, kHeight);
  size_t worst = 0;
  for (int i = 0; i < 20; ++i) {
    const FramePtr dim = dimmed(bright_frame(Time(i * 40ms)), 0.35);
    const size_t before = test::allocations();
    frames.show(*dim);
    if (i > 3) worst = std::max(worst, test::allocations() - before);
  }
  EXPECT_EQ(worst, 0u);
}

}  // namespace
}  // namespace sightline::observe
