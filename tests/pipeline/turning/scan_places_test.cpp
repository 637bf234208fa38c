// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/turning/scan_places.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/random.hpp"

namespace sightline {
namespace {

TEST(ScanPlaces, APictureIsAsWideAsItsLensSays) {
  const auto model = CameraModel::create(
      {.width = 641, .height = 481, .fx = 320, .fy = 320, .cx = 320, .cy = 240}, "head");
  const HeadAngles view = view_angles(*model);
  EXPECT_NEAR(view.x(), 2 * std::atan(1.0), 1e-9);
  EXPECT_NEAR(view.y(), 2 * std::atan(0.75), 1e-9);
}

// Whatever the range, the view and where it begins: all that the range lets it see is seen, places
// lie within the range.
TEST(ScanPlaces, NothingIsLeftOut) {
  test::Random random(6);
  for (int trial = 0; trial < 60; ++trial) {
    HeadLimits limits;
    limits.low = HeadAngles(-random.uniform(0.05, 2.9), -random.uniform(0.05, 0.7));
    limits.high = HeadAngles(random.uniform(0.05, 2.9), random.uniform(0.05, 0.9));
    const HeadAngles view(random.uniform(0.3, 1.4), random.uniform(0.3, 1.0));
    const HeadAngles from(random.uniform(-3, 3), random.uniform(-1, 1));
    const auto places = scan_places(from, view, limits);
    ASSERT_FALSE(places.empty());
    EXPECT_EQ(places[0], from.cwiseMax(limits.low).cwiseMin(limits.high));
    for (const HeadAngles& place : places) {
      EXPECT_TRUE((place.array() >= limits.low.array() - 1e-12).all());
      EXPECT_TRUE((place.array() <= limits.high.array() + 1e-12).all());
    }
    for (int i = 0; i < 200; ++i) {
      const HeadAngles point(random.uniform(limits.low.x(), limits.high.x()),
                             random.uniform(limits.low.y(), limits.high.y()));
      const bool seen = std::ranges::any_of(places, [&](const HeadAngles& place) {
        const double pan = std::abs(place.x() - point.x()) * std::cos(point.y());
        return pan <= view.x() / 2 && std::abs(place.y() - point.y()) <= view.y() / 2;
      });
      EXPECT_TRUE(seen) << trial << ": " << point.transpose();
    }
    if (testing::Test::HasFailure()) return;
  }
}

TEST(ScanPlaces, RingByRing) {
  HeadLimits limits;
  limits.low = HeadAngles(-1, -0.5);
  limits.high = HeadAngles(1, 0.5);
  const HeadAngles view(0.3, 0.3);
  const auto places = scan_places({0, 0}, view, limits);
  size_t last = 0;
  for (size_t i = 1; i < places.size(); ++i) {
    const auto ring = [&](const HeadAngles& place) {
      const HeadAngles off(place.x() * std::cos(place.y()) / 0.2, place.y() / 0.2);
      return static_cast<size_t>(std::ceil(off.cwiseAbs().maxCoeff() - 1e-6));
    };
    EXPECT_GE(ring(places[i]), last);
    last = std::max(last, ring(places[i]));
  }
  EXPECT_GE(last, 4u);
  limits.low = HeadAngles(-2.9, -1.4);
  limits.high = HeadAngles(2.9, 1.4);
  EXPECT_LE(scan_places({0, 0}, {0.01, 0.01}, limits).size(), kMostScanPlaces);
}

}  // namespace
}  // namespace sightline
