// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/triangulation.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "lenses.hpp"
#include "support/matchers.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;
using test::MatrixNear;

/// A camera at `position` that looks at `target`, z of the world up.
CalibratedCamera camera_looking(const std::string& name, const CameraModel::Parameters& p,
                                const Eigen::Vector3d& position, const Eigen::Vector3d& target) {
  const Eigen::Vector3d z = (target - position).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d r;
  r << x, z.cross(x), z;
  return {name, CameraModel::create(p, name).value(), Rigid3(Eigen::Quaterniond(r), position), 0.3};
}

std::vector<CalibratedCamera> rig() {
  const auto lens = test::lenses();
  const Eigen::Vector3d target(0.1, 0.05, 0.2);
  return {camera_looking("left", lens[1].parameters, {-0.5, -1, 0.6}, target),
          camera_looking("right", lens[3].parameters, {0.6, -1, 0.5}, target),
          camera_looking("fish", lens[8].parameters, {0.2, 1.2, 0.9}, target)};
}

std::vector<PointSight> sights_of(const std::vector<CalibratedCamera>& cameras,
                                  const Eigen::Vector3d& point, double sigma_px) {
  std::vector<PointSight> sights;
  for (const CalibratedCamera& camera : cameras) {
    const auto pixel = camera.model.project(camera.world_from_camera.inverse() * point);
    sights.push_back({&camera, pixel.value(), sigma_px});
  }
  return sights;
}

TEST(Triangulation, FindsThePointExactlyWithoutNoise) {
  const auto cameras = rig();
  const Eigen::Vector3d point(0.12, 0.02, 0.25);
  const auto found = triangulate(sights_of(cameras, point, 0.5));
  ASSERT_THAT(found, IsOk());
  EXPECT_THAT(found->point_in_world, MatrixNear(point, 1e-8));
  EXPECT_LT(found->rms_px, 1e-5);
}

/// The covariance of the errors over many draws agrees with the one reported, and their
/// normalized square is 3 on average.
TEST(Triangulation, CovarianceAgreesWithMonteCarlo) {
  const auto cameras = rig();
  const Eigen::Vector3d point(0.12, 0.02, 0.25);
  std::mt19937 rng(17);
  std::normal_distribution<double> normal;
  Eigen::Matrix3d sampled = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d reported = Eigen::Matrix3d::Zero();
  double normalized = 0;
  constexpr int kDraws = 4000;
  for (int i = 0; i < kDraws; ++i) {
    auto sights = sights_of(cameras, point, 0.5);
    sights[1].sigma_px = 1.0;  // unequal weights must count
    for (PointSight& s : sights) s.pixel += s.sigma_px * Eigen::Vector2d(normal(rng), normal(rng));
    const auto found = triangulate(sights);
    ASSERT_THAT(found, IsOk());
    const Eigen::Vector3d error = found->point_in_world - point;
    sampled += error * error.transpose() / kDraws;
    reported += found->covariance / kDraws;
    normalized += error.dot(found->covariance.inverse() * error) / kDraws;
  }
  EXPECT_THAT(sampled, MatrixNear(reported, 0.06 * reported.diagonal().maxCoeff()));
  EXPECT_NEAR(normalized, 3, 4 * std::sqrt(6.0 / kDraws));
}

TEST(Triangulation, RefusesFewerThanTwoSights) {
  const auto cameras = rig();
  auto sights = sights_of(cameras, {0.1, 0, 0.2}, 0.5);
  sights.resize(1);
  EXPECT_THAT(triangulate(sights), FailsWith("needs two sights"));
}

TEST(Triangulation, RefusesParallelRays) {
  auto cameras = rig();
  cameras.pop_back();
  cameras[1] = cameras[0];
  cameras[1].name = "twin";
  const auto sights = sights_of(cameras, {0.1, 0, 0.2}, 0.5);
  EXPECT_THAT(triangulate(sights), FailsWith("parallel"));
}

TEST(Triangulation, RefusesRaysThatMeetBehindTheCameras) {
  const auto lens = test::lenses();
  // Side by side, looking the same way; the left one sees the point too far left.
  const std::vector<CalibratedCamera> cameras = {
      camera_looking("left", lens[0].parameters, {-0.1, 0, 0}, {-0.1, 1, 0}),
      camera_looking("right", lens[0].parameters, {0.1, 0, 0}, {0.1, 1, 0})};
  const std::vector<PointSight> sights = {{&cameras[0], {219.5, 239.5}, 0.5},
                                          {&cameras[1], {419.5, 239.5}, 0.5}};
  EXPECT_THAT(triangulate(sights), FailsWith("behind this camera"));
}

TEST(Triangulation, RefusesBadSights) {
  const auto cameras = rig();
  auto sights = sights_of(cameras, {0.1, 0, 0.2}, 0.5);
  sights[1].sigma_px = 0;
  EXPECT_THAT(triangulate(sights), FailsWith("right: sigma"));
  sights[1].sigma_px = 1;
  sights[0].pixel.x() = std::nan("");
  EXPECT_THAT(triangulate(sights), FailsWith("left: pixel"));
}

}  // namespace
}  // namespace sightline
