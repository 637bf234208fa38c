// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/judge/moving_detections.hpp"

#include <gtest/gtest.h>

namespace sightline::observe {
namespace {

// A pose that has been found at `seconds`, `x` along, turned by `angle`.
Detection found(double seconds, double x, double angle = 0) {
  Detection out;
  out.time = Time() + from_seconds(seconds);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitX()));
  out.poses.push_back({Rigid3(turn, {x, 0, 1}), Vector6::Zero(), 0.5, 2});
  return out;
}

struct MovingRow : testing::Test {
  MovingDetections row{Eigen::Vector3d::Zero(), 0.1, rotation_angle};
};

TEST_F(MovingRow, ThreeThatMoveSteadilyAreBelieved) {
  EXPECT_FALSE(row.confirms(found(0, 0)));
  EXPECT_EQ(row.newest(), nullptr) << "something is found once in most searches";
  EXPECT_FALSE(row.confirms(found(0.2, 0.1, 0.4)));
  EXPECT_NE(row.newest(), nullptr);
  EXPECT_TRUE(row.confirms(found(0.4, 0.2, 0.8)));
  EXPECT_FALSE(row.confirms(found(0.6, 0.3, 1.2))) << "it starts anew";
}

TEST_F(MovingRow, OneWithoutARivalIsWorthALook) {
  EXPECT_EQ(row.promising(), nullptr);
  Detection first = found(0, 0);
  first.runner_up = 0.4;
  EXPECT_FALSE(row.confirms(first));
  EXPECT_EQ(row.promising(), nullptr) << "something else is nearly as good";
  row.clear();
  EXPECT_FALSE(row.confirms(found(0, 0)));
  ASSERT_NE(row.promising(), nullptr);
  EXPECT_EQ(row.promising()->time, Time());
}

TEST_F(MovingRow, WhatStandsStillIsNotHoweverOften) {
  for (int i = 0; i < 8; ++i) EXPECT_FALSE(row.confirms(found(0.2 * i, 0.01 * (i % 2))));
}

TEST_F(MovingRow, AnotherOrientationStartsItAnew) {
  EXPECT_FALSE(row.confirms(found(0, 0)));
  EXPECT_FALSE(row.confirms(found(0.2, 0.1, 2.0)));
  EXPECT_FALSE(row.confirms(found(0.4, 0.2, 2.1)));
  EXPECT_TRUE(row.confirms(found(0.6, 0.3, 2.2)));
}

TEST_F(MovingRow, ToAndFroStartsItAnew) {
  EXPECT_FALSE(row.confirms(found(0, 0)));
  EXPECT_FALSE(row.confirms(found(0.2, 0.2)));
  EXPECT_FALSE(row.confirms(found(0.4, 0))) << "clutter, here and there";
}

TEST_F(MovingRow, NothingFoundOrLongAgoStartsItAnew) {
  EXPECT_FALSE(row.confirms(found(0, 0)));
  EXPECT_FALSE(row.confirms(found(0.2, 0.1)));
  EXPECT_FALSE(row.confirms(Detection()));
  EXPECT_FALSE(row.confirms(found(0.6, 0.3)));
  EXPECT_FALSE(row.confirms(found(2.6, 0.4)));
  EXPECT_FALSE(row.confirms(found(2.8, 0.5)));
}

TEST_F(MovingRow, KnowsWhatContinuesIt) {
  EXPECT_FALSE(row.continued_by(found(0, 0))) << "there is nothing yet";
  EXPECT_FALSE(row.confirms(found(0, 0)));
  EXPECT_TRUE(row.continued_by(found(0.2, 0.1)));
  EXPECT_FALSE(row.continued_by(found(0.2, 1.0)));
  EXPECT_FALSE(row.continued_by(Detection()));
}

}  // namespace
}  // namespace sightline::observe
