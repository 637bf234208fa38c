// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/point_list.hpp"

#include <gtest/gtest.h>

#include "../support/matchers.hpp"

namespace sightline {
namespace {

using test::FailsWith;

TEST(PointList, ReadsNumbersBetweenBlanksCommasAndSemicolons) {
  const auto list = parse_points("# heading\n1 2 3\n\n 4,5.5;-6e1  # why\r\n", "p.txt", 0.001);
  ASSERT_THAT(list, test::IsOk());
  ASSERT_EQ(list->points.size(), 2u);
  EXPECT_EQ(list->points[0], Eigen::Vector3d(0.001, 0.002, 0.003));
  EXPECT_TRUE(list->points[1].isApprox(Eigen::Vector3d(0.004, 0.0055, -0.06)));
  EXPECT_EQ(list->lines, (std::vector<size_t>{2, 4}));
}

TEST(PointList, LastLineNeedsNoEnd) { EXPECT_EQ(parse_points("1 2 3", "p")->points.size(), 1u); }

TEST(PointList, RefusesByLine) {
  EXPECT_THAT(parse_points("1 2 3\n4 5\n", "p.txt"), FailsWith("p.txt:2: 2 numbers"));
  EXPECT_THAT(parse_points("1 2 3 4\n", "p.txt"), FailsWith("p.txt:1: 4 numbers"));
  EXPECT_THAT(parse_points("x,y,z\n1 2 3\n", "p.txt"), FailsWith("p.txt:1: 'x' is not a number"));
  EXPECT_THAT(parse_points("1 2 inf\n", "p.txt"), FailsWith("not finite"));
  EXPECT_THAT(parse_points("1 2 1e999\n", "p.txt"), FailsWith("not finite"));
  EXPECT_THAT(parse_points("# only words\n", "p.txt"), FailsWith("holds no points"));
  EXPECT_THAT(parse_points("", "p.txt"), FailsWith("holds no points"));
}

TEST(PointList, MissingFileIsNamed) {
  EXPECT_THAT(read_points("/nowhere/p.txt"), FailsWith("/nowhere/p.txt"));
}

}  // namespace
}  // namespace sightline
