// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/overlay/point_marks.hpp"

#include <gtest/gtest.h>

#include <cstring>

#include "../support/random.hpp"
#include "sightline/image/image.hpp"

namespace sightline {
namespace {

std::unique_ptr<Image> gray(int width, int height) {
  auto image = std::make_unique<Image>(width, height);
  const auto view = image->mutable_view();
  for (const auto& plane : {view.y, view.u, view.v}) {
    for (int y = 0; y < plane.height; ++y) {
      std::memset(plane.row(y), 128, static_cast<size_t>(plane.width));
    }
  }
  return image;
}

Yuv at(const Image& image, int x, int y) {
  const I420View view = image.view();
  return {view.y.row(y)[x], view.u.row(y / 2)[x / 2], view.v.row(y / 2)[x / 2]};
}

TEST(DepthColor, NearIsGreenFarIsBlue) {
  const DepthScale scale{1, 3};
  EXPECT_EQ(depth_color(0.5, scale), (Rgb{0, 255, 0}));
  EXPECT_EQ(depth_color(1, scale), (Rgb{0, 255, 0}));
  EXPECT_EQ(depth_color(2, scale), (Rgb{0, 255, 255}));
  EXPECT_EQ(depth_color(3, scale), (Rgb{0, 0, 255}));
  EXPECT_EQ(depth_color(9, scale), (Rgb{0, 0, 255}));
}

TEST(DepthScale, FitsAndNeverCollapses) {
  const std::vector<PointMark> marks = {{{0, 0}, 2.0}, {{0, 0}, 1.5}, {{0, 0}, 4.0}};
  EXPECT_EQ(fit_depth_scale(marks).near_m, 1.5);
  EXPECT_EQ(fit_depth_scale(marks).far_m, 4.0);
  const DepthScale flat = fit_depth_scale(std::span(marks).first(1));
  EXPECT_GT(flat.far_m, flat.near_m);
}

TEST(PointMarks, NearOnesLieOnTopWhateverTheirOrder) {
  const std::vector<PointMark> marks = {{{20, 20}, 1.0, PointKind::kEdge},
                                        {{20, 20}, 2.0, PointKind::kEdge}};
  const auto image = gray(40, 40);
  draw_point_marks(image->mutable_view(), marks, {1, 2}, {6, 9});
  const Yuv green = to_yuv({0, 255, 0});
  EXPECT_NEAR(at(*image, 20, 20).y, green.y, 2);
  EXPECT_NEAR(at(*image, 20, 20).u, green.u, 12);
}

TEST(PointMarks, HiddenOnesAreOpenAndEveryPlaceIsSafe) {
  const auto solid = gray(40, 40), open = gray(40, 40);
  PointMark mark{{20, 20}, 1.0, PointKind::kEdge, false};
  draw_point_marks(solid->mutable_view(), {&mark, 1}, {1, 2}, {9, 9});
  mark.hidden = true;
  draw_point_marks(open->mutable_view(), {&mark, 1}, {1, 2}, {9, 9});
  EXPECT_NE(at(*solid, 20, 20).y, 128);
  EXPECT_EQ(at(*open, 20, 20).y, 128);

  test::Random random(3);
  std::vector<PointMark> anywhere;
  for (int i = 0; i < 500; ++i) {
    const auto kind = static_cast<PointKind>(i % 3);
    anywhere.push_back({{random.uniform(-100, 140), random.uniform(-100, 140)},
                        random.uniform(0.1, 9),
                        kind,
                        i % 2 == 0});
  }
  anywhere.push_back({{1e300, std::numeric_limits<double>::quiet_NaN()}, 1, PointKind::kCorner});
  const auto odd = gray(39, 41);
  draw_point_marks(odd->mutable_view(), anywhere, fit_depth_scale(anywhere));
}

TEST(EnclosingCircle, HoldsAllAndIsSmallest) {
  EXPECT_FALSE(enclosing_circle({}));
  test::Random random(7);
  for (int round = 0; round < 200; ++round) {
    std::vector<Eigen::Vector2d> pixels;
    const int count = 1 + static_cast<int>(random.bits() % 40);
    for (int i = 0; i < count; ++i) {
      pixels.emplace_back(random.uniform(0, 640), round % 3 == 0 ? 7 : random.uniform(0, 480));
    }
    const auto circle = enclosing_circle(pixels);
    ASSERT_TRUE(circle);
    double farthest = 0;
    for (const auto& pixel : pixels) {
      farthest = std::max(farthest, (pixel - circle->center).norm());
    }
    EXPECT_LE(farthest, circle->radius + 1e-6);
    // No other center nearby does with less: the function of the center is convex.
    for (int i = 0; i < 16; ++i) {
      const Eigen::Vector2d other =
          circle->center + 0.01 * Eigen::Vector2d(std::cos(i * 0.3927), std::sin(i * 0.3927));
      double reach = 0;
      for (const auto& pixel : pixels) reach = std::max(reach, (pixel - other).norm());
      EXPECT_GE(reach, circle->radius - 1e-6);
    }
  }
}

TEST(BoundingMarkers, SurroundThePixels) {
  const std::vector<Eigen::Vector2d> pixels = {{30, 30}, {70, 30}, {50, 60}};
  const auto image = gray(100, 100);
  draw_bounding_rectangle(image->mutable_view(), pixels, {70, 225, 120}, 2, 5);
  const uint8_t line = to_yuv({70, 225, 120}).y;
  EXPECT_NEAR(at(*image, 50, 25).y, line, 60);
  EXPECT_NE(at(*image, 25, 45).y, 128);
  EXPECT_EQ(at(*image, 50, 45).y, 128);
  const auto round = gray(100, 100);
  draw_bounding_circle(round->mutable_view(), pixels, {70, 225, 120}, 2, 5);
  EXPECT_EQ(at(*round, 50, 45).y, 128);
  EXPECT_NE(at(*round, 25, 35).y, 128);
}

}  // namespace
}  // namespace sightline
