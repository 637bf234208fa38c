// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/rolling_shutter.hpp"

#include <gtest/gtest.h>

#include "support/lens_camera.hpp"

namespace sightline {
namespace {

CalibratedCamera camera(double readout_s) {
  CalibratedCamera out = test::lens_camera();
  out.readout_s = readout_s;
  return out;
}

// A point that is seen in that row.
Eigen::Vector3d in_row(double row) { return *camera(0).model.unproject({300, row}); }

TEST(RowDelay, GrowsFromTheFirstRowToTheLast) {
  const CalibratedCamera rolling = camera(0.024);
  EXPECT_NEAR(row_delay_s(rolling, in_row(239.5)), 0, 1e-9);
  EXPECT_NEAR(row_delay_s(rolling, in_row(239.5 + 100)), 0.005, 1e-9);
  EXPECT_NEAR(row_delay_s(rolling, in_row(239.5 - 100)), -0.005, 1e-9);
  EXPECT_NEAR(row_delay_s(rolling, 2 * in_row(339.5)), 0.005, 1e-9) << "however far";
}

TEST(RowDelay, EndsAtTheBordersOfTheImage) {
  const CalibratedCamera rolling = camera(0.024);
  for (const double row : {-2000.0, -0.5}) EXPECT_NEAR(row_delay_s(rolling, row), -0.012, 1e-12);
  for (const double row : {479.5, 2000.0}) EXPECT_NEAR(row_delay_s(rolling, row), 0.012, 1e-12);
  EXPECT_NEAR(row_delay_s(rolling, in_row(490)), 0.012, 1e-9);
  EXPECT_EQ(row_delay_s(rolling, Eigen::Vector3d(0, 0.5, -1)), 0) << "behind the camera";
}

TEST(RowDelay, FromTheBottomUpAndNotAtAll) {
  EXPECT_NEAR(row_delay_s(camera(-0.024), in_row(339.5)), -0.005, 1e-9);
  EXPECT_EQ(row_delay_s(camera(0), in_row(339.5)), 0);
}

}  // namespace
}  // namespace sightline
