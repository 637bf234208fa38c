// SPDX-License-Identifier: Apache-2.0
// How corners move, from the images before and after.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "../support/random.hpp"
#include "pipeline/calibrate/image_sets.hpp"

namespace sightline::pipeline {
namespace {

// To and fro by 60 px at 0.8 Hz, as a hand does, and a little across.
Eigen::Vector2d place(double t) { return {300 + 60 * std::sin(5 * t), 200 + 20 * std::cos(3 * t)}; }
Eigen::Vector2d speed(double t) { return {300 * std::cos(5 * t), -60 * std::sin(3 * t)}; }
Eigen::Vector2d change(double t) { return {-1500 * std::sin(5 * t), -180 * std::cos(3 * t)}; }

std::vector<TimedCorners> images(double rate_hz, double noise_px, int count) {
  test::Random random(3);
  std::vector<TimedCorners> found;
  for (int i = 0; i < count; ++i) {
    TimedCorners image;
    image.time_s = (i + random.uniform(-0.1, 0.1)) / rate_hz;  // stamps are not even
    image.corners.push_back({7, place(image.time_s) + noise_px * random.normal<2>()});
    found.push_back(std::move(image));
  }
  return found;
}

struct Errors {
  double speed = 0, change = 0;  // root mean square
};

Errors errors(const std::vector<TimedCorners>& found) {
  Errors sums;
  for (size_t i = 5; i + 5 < found.size(); ++i) {
    const double t = found[i].time_s;
    sums.speed += (found[i].corners[0].px_per_s - speed(t)).squaredNorm();
    sums.change += (found[i].corners[0].px_per_s2 - change(t)).squaredNorm();
  }
  const auto count = static_cast<double>(found.size() - 10);
  return {std::sqrt(sums.speed / count), std::sqrt(sums.change / count)};
}

TEST(CornerMotion, OfImagesThatAreFarApartFollowsAHandThatTurnsBack) {
  std::vector<TimedCorners> found = images(10, 0, 60);
  add_motion(found, 0.25);
  const Errors e = errors(found);
  EXPECT_LT(e.speed, 3);    // of 200 px/s; by the images next to it alone: 9
  EXPECT_LT(e.change, 60);  // of 1000 px/s^2
}

// A camera whose stamps are 0.1 s off has its corners carried that far.
TEST(CornerMotion, OfImagesThatAreCloseTogetherIsNotTheirNoise) {
  std::vector<TimedCorners> found = images(60, 0.1, 200);
  add_motion(found, 0.042);
  const Errors e = errors(found);
  EXPECT_LT(0.1 * e.speed, 0.5);
  EXPECT_LT(0.5 * 0.1 * 0.1 * e.change, 0.8);
}

TEST(CornerMotion, AtTheEndsIsThatToTheNextImageAndOfOneIsNone) {
  std::vector<TimedCorners> found = images(10, 0, 3);
  add_motion(found, 0.25);
  const Eigen::Vector2d way = found[1].corners[0].pixel - found[0].corners[0].pixel;
  EXPECT_LT((found[0].corners[0].px_per_s * (found[1].time_s - found[0].time_s) - way).norm(),
            1e-9);
  EXPECT_EQ(found[0].corners[0].px_per_s2.norm(), 0);
  EXPECT_GT(found[1].corners[0].px_per_s2.norm(), 0);
  std::vector<TimedCorners> alone = images(10, 0, 2);
  add_motion(alone, 0.05);
  for (const TimedCorners& image : alone) EXPECT_EQ(image.corners[0].px_per_s.norm(), 0);
}

}  // namespace
}  // namespace sightline::pipeline
