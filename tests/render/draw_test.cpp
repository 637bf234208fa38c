// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/lines/draw.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "sightline/image/image.hpp"
#include "test_images.hpp"

namespace sightline {
namespace {

using draw::Point;
using draw::Stroke;
using test::differing_luma;
using test::GrayImage;
using test::Nv12Image;

constexpr Yuv kRed{81, 90, 240};

/// Sum of the luma taken off a white image, in units of one fully black pixel.
double ink(const GrayImage& image, int background) {
  double sum = 0;
  test::for_each_luma(image.view(), [&](int, int, int y) { sum += background - y; });
  return sum / (background - 16);
}

TEST(Draw, LineHasItsLengthAndWidth) {
  for (const auto& [a, b] : {std::pair{Point(20, 30), Point(80, 30)},
                             std::pair{Point(20.3f, 15.1f), Point(71.9f, 66.6f)},
                             std::pair{Point(40, 80), Point(43.5f, 12)}}) {
    GrayImage image(100, 90, 235);
    draw::line(draw::canvas_of(image.mutable_view()), a, b, {{16, 128, 128}, 3, 1, false});
    const double length = (b - a).cast<double>().norm();
    EXPECT_NEAR(ink(image, 235), 3 * length, 0.05 * length + 2);
  }
}

TEST(Draw, LineKeepsItsColorInChroma) {
  GrayImage image(64, 64, 120);
  draw::line(draw::canvas_of(image.mutable_view()), {8, 21}, {56, 44}, {kRed, 2, 1, false});
  int strongest = 128;
  for (int x = 0; x < 32; ++x) {
    for (int y = 0; y < 32; ++y) strongest = std::max<int>(strongest, image.view().v.row(y)[x]);
  }
  EXPECT_GT(strongest, 225);
}

TEST(Draw, NothingOutsideTheLine) {
  GrayImage image(101, 57, 128);
  draw::line(draw::canvas_of(image.mutable_view()), {10, 10}, {90, 50}, {kRed, 2, 1, false});
  const Point along = Point(80, 40).normalized();
  for (const auto& [x, y] : differing_luma(image.view(), 128)) {
    const Point d = Point(static_cast<float>(x), static_cast<float>(y)) - Point(10, 10);
    EXPECT_LT(std::abs(along.x() * d.y() - along.y() * d.x()), 1.51f);
    EXPECT_GT(along.dot(d), -0.51f);
  }
}

TEST(Draw, DashesLeaveGapsAndRunOnAroundCorners) {
  GrayImage solid(120, 40, 235);
  GrayImage dashed(120, 40, 235);
  const std::array<Point, 3> corner = {Point(10, 10), Point(59, 10), Point(110, 10)};
  const Stroke stroke{{16, 128, 128}, 2, 1, false};
  draw::polyline(draw::canvas_of(solid.mutable_view()), corner, stroke);
  draw::polyline(draw::canvas_of(dashed.mutable_view()), corner, stroke, {8, 6});
  const double share = ink(dashed, 235) / ink(solid, 235);
  EXPECT_NEAR(share, 8.0 / 14.0, 0.08);
  // The pattern is that of one straight line: a dash starts every 14 px.
  for (int k = 0; k < 7; ++k) EXPECT_LT(dashed.view().y.row(10)[10 + 14 * k + 4], 40) << k;
  for (int k = 0; k < 7; ++k) EXPECT_GT(dashed.view().y.row(10)[10 + 14 * k + 11], 200) << k;
}

TEST(Draw, CircleLiesAtItsRadius) {
  GrayImage image(120, 110, 200);
  const Point center(60.25f, 50.5f);
  draw::circle(draw::canvas_of(image.mutable_view()), center, 31, {{16, 128, 128}, 2, 1, false});
  double sum = 0;
  for (const auto& [x, y] : differing_luma(image.view(), 200)) {
    const float r = (Point(static_cast<float>(x), static_cast<float>(y)) - center).norm();
    EXPECT_NEAR(r, 31, 1.51);
    sum += 1;
  }
  EXPECT_GT(sum, 2 * 3.14 * 31 * 2);
  EXPECT_NEAR(ink(image, 200), 2 * 3.1416 * 31 * 2, 8);
}

TEST(Draw, DashedCircleLiesAtItsRadius) {
  GrayImage image(120, 110, 200);
  const Point center(60, 50);
  draw::dashed_circle(draw::canvas_of(image.mutable_view()), center, 40,
                      {{16, 128, 128}, 2, 1, false}, {8, 6});
  for (const auto& [x, y] : differing_luma(image.view(), 200)) {
    const float r = (Point(static_cast<float>(x), static_cast<float>(y)) - center).norm();
    EXPECT_NEAR(r, 40, 1.9);
  }
  EXPECT_NEAR(ink(image, 200), 2 * 3.1416 * 40 * 2 * 8 / 14, 25);
}

TEST(Draw, PolygonHasItsArea) {
  for (const bool turned : {false, true}) {
    GrayImage image(80, 80, 235);
    std::array<Point, 3> corners = {Point(10, 10), Point(60, 20), Point(30, 70)};
    if (turned) std::swap(corners[0], corners[1]);
    draw::polygon(draw::canvas_of(image.mutable_view()), corners, {16, 128, 128}, 1);
    EXPECT_NEAR(ink(image, 235), 0.5 * (50 * 60 - 10 * 20), 12);
  }
}

TEST(Draw, Nv12AndI420ShowTheSame) {
  GrayImage i420(97, 63, 120);
  Nv12Image nv12(97, 63, 120);
  for (const draw::Canvas& canvas :
       {draw::canvas_of(i420.mutable_view()), draw::canvas_of(nv12.mutable_view())}) {
    draw::line(canvas, {3, 60}, {95, 1}, {kRed, 2, 0.7f, false});
    draw::circle(canvas, {96, 62}, 20, {{200, 30, 90}, 3, 1, false});
    draw::polygon(canvas, std::array<Point, 3>{Point(-5, 5), Point(20, 9), Point(7, 40)}, kRed, 1);
  }
  EXPECT_TRUE(test::same_pixels(i420.view(), nv12.view()));
}

TEST(Draw, StaysInsideTheImageWhateverComes) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  GrayImage image(33, 17, 128);
  const draw::Canvas canvas = draw::canvas_of(image.mutable_view());
  const std::array<float, 9> odd = {kNan, kInf, -kInf, 1e30f, -1e30f, 1e7f, -1e7f, -3, 40};
  for (const float p : odd) {
    for (const float q : odd) {
      draw::line(canvas, {p, q}, {5, 5}, {kRed, 4, 1, false});
      draw::line(canvas, {q, 5}, {p, 1}, {kRed, 4, 1, false});
      const std::array<Point, 3> bent = {Point(p, 4), Point(8, q), Point(q, p)};
      draw::polyline(canvas, bent, {kRed, 2, 1, false}, {8, 6});
      draw::polygon(canvas, bent, kRed, 1);
      draw::circle(canvas, {p, q}, 12, {kRed, 2, 1, false});
      draw::circle(canvas, {5, 5}, p, {kRed, 2, 1, false});
      draw::dashed_circle(canvas, {p, 5}, q, {kRed, 2, 1, false}, {8, 6});
    }
  }
  SUCCEED();
}

}  // namespace
}  // namespace sightline
