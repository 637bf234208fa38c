// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/point_cloud.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "support/matchers.hpp"

namespace sightline {
namespace {

TEST(PointCloud, IsAPlyWithAllItIsGiven) {
  CloudPoint corner;
  corner.point.point_in_world = {1.25, -2.5, 0.125};
  corner.point.covariance = Eigen::Vector3d(1e-6, 4e-6, 1e-8).asDiagonal();
  corner.point.kind = PointKind::kCorner;
  corner.time = time_from_ns(1'500'000'000);
  corner.rgb = {10, 200, 30};
  CloudPoint edge;
  edge.point.kind = PointKind::kEdge;
  const std::filesystem::path path = ::testing::TempDir() + "cloud.ply";
  ASSERT_THAT(write_point_cloud(path, std::vector{corner, edge}), test::IsOk());
  std::ifstream in(path);
  std::string line, header;
  while (std::getline(in, line) && line != "end_header") header += line + "\n";
  EXPECT_EQ(header.rfind("ply\nformat ascii 1.0\n", 0), 0u);
  EXPECT_NE(header.find("element vertex 2\n"), std::string::npos);
  double x = 0, y = 0, z = 0, sigma = 0, t = 0;
  int red = 0, green = 0, blue = 0, kind = 0;
  in >> x >> y >> z >> red >> green >> blue >> kind >> sigma >> t;
  EXPECT_EQ(x, 1.25);
  EXPECT_EQ(y, -2.5);
  EXPECT_EQ(z, 0.125);
  EXPECT_EQ(red, 10);
  EXPECT_EQ(green, 200);
  EXPECT_EQ(blue, 30);
  EXPECT_EQ(kind, 2);
  EXPECT_EQ(sigma, 0.002);
  EXPECT_EQ(t, 1.5);
  in >> x >> y >> z >> red >> green >> blue >> kind >> sigma >> t;
  EXPECT_EQ(kind, 1);
  EXPECT_TRUE(in);
}

TEST(PointCloud, SaysWhichFileCannotBeWritten) {
  EXPECT_THAT(write_point_cloud("/nowhere/cloud.ply", {}), test::FailsWith("/nowhere/cloud.ply"));
}

}  // namespace
}  // namespace sightline
