// SPDX-License-Identifier: Apache-2.0
#include "observe/track/contour_lines.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "sightline/image/image.hpp"

namespace sightline::observe {
namespace {

constexpr int kSize = 64;
constexpr uint8_t kObjectLuma = 180, kBackgroundLuma = 60;

enum class Border { kLeft, kRight, kTop, kBottom };

int distance_to(Border border, int x, int y) {
  switch (border) {
    case Border::kLeft:
      return x;
    case Border::kRight:
      return kSize - 1 - x;
    case Border::kTop:
      return y;
    default:
      return kSize - 1 - y;
  }
}

// The object begins two pixels from the border; the outermost pixel has its color too.
void draw(Border border, Image& image) {
  const MutableI420View view = image.mutable_view();
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const bool background = distance_to(border, x, y) == 1;
      view.y.row(y)[x] = background ? kBackgroundLuma : kObjectLuma;
    }
  }
  for (int y = 0; y < kSize / 2; ++y) {
    std::fill_n(view.u.row(y), kSize / 2, uint8_t{128});
    std::fill_n(view.v.row(y), kSize / 2, uint8_t{128});
  }
}

// A line whose outward end leaves the image.
ContourLine line_at(Border border) {
  constexpr double kFromBorder = 2.3, kAlong = 30.2;
  ContourLine line;
  const double high = kSize - 1 - kFromBorder;
  switch (border) {
    case Border::kLeft:
      line.center = {kFromBorder, kAlong}, line.normal = {-1, 0};
      break;
    case Border::kRight:
      line.center = {high, kAlong}, line.normal = {1, 0};
      break;
    case Border::kTop:
      line.center = {kAlong, kFromBorder}, line.normal = {0, -1};
      break;
    case Border::kBottom:
      line.center = {kAlong, high}, line.normal = {0, 1};
      break;
  }
  line.inside_px = line.outside_px = 10;
  return line;
}

ContourLine measured_at(Border border, int scale) {
  ColorHistograms colors;
  const std::vector<uint16_t> object(100, ColorBins::of(kObjectLuma, 128, 128));
  const std::vector<uint16_t> background(100, ColorBins::of(kBackgroundLuma, 128, 128));
  EXPECT_TRUE(colors.learn(object, background, 1));
  Image image(kSize, kSize);
  draw(border, image);
  ContourLine line = line_at(border);
  measure_lines(ColorReader(image.view()), colors, scale, {&line, 1});
  EXPECT_TRUE(line.measured);
  return line;
}

// What is outside of the image counts for no pixel of it, at whichever border.
TEST(ContourLines, AllBordersMeasureTheSame) {
  for (const int scale : {1, 2, 3}) {
    const ContourLine right = measured_at(Border::kRight, scale);
    for (const Border border : {Border::kLeft, Border::kTop, Border::kBottom}) {
      const ContourLine line = measured_at(border, scale);
      EXPECT_NEAR(line.mean, right.mean, 1e-3) << "scale " << scale;
      EXPECT_NEAR(line.variance, right.variance, 1e-3) << "scale " << scale;
      EXPECT_NEAR(line.outside_evidence, right.outside_evidence, 1e-4) << "scale " << scale;
      EXPECT_NEAR(line.outside_level, right.outside_level, 1e-3) << "scale " << scale;
    }
  }
}

}  // namespace
}  // namespace sightline::observe
