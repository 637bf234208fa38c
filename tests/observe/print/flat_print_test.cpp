// SPDX-License-Identifier: Apache-2.0
#include "observe/track/print/flat_print.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace sightline::observe {
namespace {

using std::chrono::milliseconds;
using Points = std::vector<TexturePoints::Found>;

constexpr double kDiameter = 0.14;  // [m], of a cube of 80 mm

// So many on the front side of the cube, and on the one to its right.
Points points_on(int front, int right) {
  Points points;
  for (int i = 0; i < front; ++i) {
    points.push_back({{-0.03 + 0.01 * (i % 7), -0.03 + 0.01 * (i / 7), -0.04}, {0, 0}});
  }
  for (int i = 0; i < right; ++i) {
    points.push_back({{0.04, -0.03 + 0.01 * (i % 7), -0.03 + 0.01 * (i / 7)}, {0, 0}});
  }
  return points;
}

// Seen by a camera at the origin of the world that looks along its z.
Rigid3 at(double x, double z, double turn = 0) {
  Vector6 twist;
  twist << 0, turn, 0, 0, 0, 0;
  Rigid3 pose = Rigid3::exp(twist);
  pose.translation = {x, 0, z};
  return pose;
}

class FlatPrintTest : public testing::Test {
 protected:
  PrintSeen look(const Rigid3& pose, const Points& points = points_on(20, 0),
                 Duration later = milliseconds(33)) {
    now_ += later;
    return print_.judge(now_, pose, points, kDiameter, Rigid3());
  }

 private:
  FlatPrint print_;
  Time now_{milliseconds(1000)};
};

TEST(SeveralPlanes, AreOfSeveralPointsThatAreOffOne) {
  EXPECT_FALSE(several_planes(points_on(21, 0), kDiameter));
  EXPECT_FALSE(several_planes(points_on(21, 3), kDiameter)) << "found by chance";
  EXPECT_TRUE(several_planes(points_on(14, 7), kDiameter));
  EXPECT_TRUE(several_planes(points_on(10, 10), kDiameter));
  EXPECT_FALSE(several_planes(points_on(3, 0), kDiameter));
  EXPECT_FALSE(several_planes({}, kDiameter));
}

TEST_F(FlatPrintTest, OneSideAtRestMayBeAPicture) {
  for (int i = 0; i < 100; ++i) EXPECT_EQ(look(at(0.001 * (i % 3), 1)), PrintSeen::kFlat);
  EXPECT_EQ(look(at(0, 1), {}), PrintSeen::kNone);
  EXPECT_EQ(look(at(0, 1), points_on(12, 9)), PrintSeen::kSolid);
  EXPECT_EQ(look(at(0, 1)), PrintSeen::kSolid) << "it is the same thing";
}

// A quarter of 0.14 m.
TEST_F(FlatPrintTest, WhatMovesAcrossTheImageIsNone) {
  double x = 0;
  for (; x < 0.03; x += 0.002) EXPECT_EQ(look(at(x, 1)), PrintSeen::kFlat) << x;
  for (; x < 0.04; x += 0.002) look(at(x, 1));
  EXPECT_EQ(look(at(x, 1)), PrintSeen::kSolid);
  EXPECT_EQ(look(at(0, 1)), PrintSeen::kSolid) << "moved, whether it comes back";
}

// The pose of a plane seen from the front flips between two tilts, and its distance is uncertain;
// the picture stays where it is.
TEST_F(FlatPrintTest, TiltsAndDistancesThatKeepItsPlaceDoNotMoveIt) {
  const Eigen::Vector3d middle(0, 0, -0.04);  // of the side
  for (int i = 0; i < 30; ++i) {
    Rigid3 pose = at(0, 1, i % 2 == 0 ? 0.3 : -0.3);
    const double distance = 1 + 0.05 * (i % 5);
    pose.translation = Eigen::Vector3d(0.1, 0, 1) * distance - pose.rotation * middle;
    EXPECT_EQ(look(pose, points_on(20, 0)), PrintSeen::kFlat) << i;
  }
}

TEST_F(FlatPrintTest, AnotherPlaceOrALongPauseBeginsAnew) {
  look(at(0, 1));
  EXPECT_EQ(look(at(0.3, 1)), PrintSeen::kFlat) << "another picture, not one that moved";
  EXPECT_EQ(look(at(0.36, 1), points_on(20, 0), milliseconds(400)), PrintSeen::kFlat);
  EXPECT_EQ(look(at(0.42, 1), points_on(20, 0), milliseconds(200)), PrintSeen::kSolid);
}

}  // namespace
}  // namespace sightline::observe
