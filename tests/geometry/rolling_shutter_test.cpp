// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/rolling_shutter.hpp"

#include <gtest/gtest.h>

namespace sightline {
namespace {

CalibratedCamera camera(double readout_s) {
  CameraModel::Parameters lens;
  lens.width = 640;
  lens.height = 480;
  lens.fx = lens.fy = 600;
  lens.cx = 319.5;
  lens.cy = 239.5;
  CalibratedCamera out{"cam", CameraModel::create(lens, "cam").value(), Rigid3()};
  out.readout_s = readout_s;
  return out;
}

// A point that is seen in that row.
Eigen::Vector3d in_row(double row) { return {0.1, (row - 239.5) / 600, 1}; }

TEST(RowDelay, GrowsFromTheFirstRowToTheLast) {
  const CalibratedCamera rolling = camera(0.024);
  EXPECT_NEAR(row_delay_s(rolling, in_row(239.5)), 0, 1e-12);
  EXPECT_NEAR(row_delay_s(rolling, in_row(239.5 + 100)), 0.005, 1e-12);
  EXPECT_NEAR(row_delay_s(rolling, in_row(239.5 - 100)), -0.005, 1e-12);
  EXPECT_NEAR(row_delay_s(rolling, 2 * in_row(339.5)), 0.005, 1e-12) << "however far";
}

TEST(RowDelay, EndsAtTheBordersOfTheImage) {
  const CalibratedCamera rolling = camera(0.024);
  EXPECT_NEAR(row_delay_s(rolling, in_row(2000)), 0.012, 1e-12);
  EXPECT_NEAR(row_delay_s(rolling, in_row(-2000)), -0.012, 1e-12);
  EXPECT_EQ(row_delay_s(rolling, {0, 0.5, -1}), 0) << "behind the camera";
}

TEST(RowDelay, FromTheBottomUpAndNotAtAll) {
  EXPECT_NEAR(row_delay_s(camera(-0.024), in_row(339.5)), -0.005, 1e-12);
  EXPECT_EQ(row_delay_s(camera(0), in_row(339.5)), 0);
}

}  // namespace
}  // namespace sightline
