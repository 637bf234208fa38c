// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/camera_axes.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "head_axes.hpp"

namespace sightline {
namespace {

constexpr double kQuarter = std::numbers::pi / 2;

TEST(CameraAxes, PanTurnsToTheLeftAndTiltUp) {
  CameraAxes axes;
  Eigen::Matrix4d look_along_y;  // camera axes x right, y down, z ahead in x right, y ahead, z up
  look_along_y << 1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1;
  axes.tilt_from_camera = *Rigid3::from_matrix(look_along_y, "");
  const auto ahead = [&](double pan, double tilt) {
    return Eigen::Vector3d(axes.world_from_camera(pan, tilt).rotation * Eigen::Vector3d::UnitZ());
  };
  EXPECT_TRUE(ahead(0, 0).isApprox(Eigen::Vector3d::UnitY(), 1e-12));
  EXPECT_TRUE(ahead(kQuarter, 0).isApprox(-Eigen::Vector3d::UnitX(), 1e-12));
  EXPECT_TRUE(ahead(0, kQuarter).isApprox(Eigen::Vector3d::UnitZ(), 1e-12));
  const Eigen::Vector3d both = ahead(kQuarter, kQuarter / 2);
  EXPECT_NEAR(both.z(), std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(both.x(), -std::sqrt(0.5), 1e-12);
}

TEST(CameraAxes, OffsetsMoveTheCameraAroundTheAxes) {
  CameraAxes axes = test::head_axes();
  const Rigid3 at_rest = axes.world_from_camera(0, 0);
  const Rigid3 turned = axes.world_from_camera(0.3, 0);
  const Eigen::Vector3d axis_at = axes.world_from_base.translation;
  // On a circle about the pan axis.
  const auto radius = [&](const Rigid3& pose) {
    const Eigen::Vector3d in_base = axes.world_from_base.inverse() * pose.translation;
    return in_base.head<2>().norm();
  };
  EXPECT_GT(radius(at_rest), 0.01);
  EXPECT_NEAR(radius(at_rest), radius(turned), 1e-12);
  EXPECT_GT((turned.translation - axis_at).norm(), 0.01);
  EXPECT_NEAR(rotation_angle(at_rest, turned), 0.3, 1e-12);
}

TEST(CameraAxes, JacobiansAreThoseOfNumericDifferences) {
  const CameraAxes axes = test::head_axes();
  for (const auto& [pan, tilt] : {std::pair{0.0, 0.0}, {0.7, -0.3}, {-2.4, 0.9}}) {
    const auto jacobian = axes.jacobian(pan);
    constexpr double kStep = 1e-6;
    const Rigid3 pose = axes.world_from_camera(pan, tilt);
    const auto left = [&](const Rigid3& a, const Rigid3& b) {
      return Vector6((b * a.inverse()).log());  // b = exp(d) a
    };
    const Vector6 by_pan =
        left(axes.world_from_camera(pan - kStep, tilt), axes.world_from_camera(pan + kStep, tilt)) /
        (2 * kStep);
    const Vector6 by_tilt =
        left(axes.world_from_camera(pan, tilt - kStep), axes.world_from_camera(pan, tilt + kStep)) /
        (2 * kStep);
    EXPECT_LT((jacobian.col(0) - by_pan).norm(), 1e-7) << pan << " " << tilt;
    EXPECT_LT((jacobian.col(1) - by_tilt).norm(), 1e-7) << pan << " " << tilt;
    // And on the right, the camera's side, by the adjoint.
    const Vector6 right = pose.inverse().adjoint() * jacobian.col(0);
    const Rigid3 moved = axes.world_from_camera(pan + kStep, tilt);
    EXPECT_LT((difference(pose, moved) / kStep - right).norm(), 1e-5);
  }
}

TEST(CameraAxes, LensIsInterpolatedOverTheZoomsSettings) {
  CameraAxes axes;
  axes.zoom = {{0, 500, 501, 320, 240, {-0.1}, 0.001},
               {1000, 1000, 1002, 324, 236, {-0.02}, 0.003},
               {2000, 3000, 3006, 330, 230, {0.1}, 0.002}};
  const ZoomLens at_one = axes.lens_at(1000);
  EXPECT_DOUBLE_EQ(at_one.fx, 1000);
  EXPECT_DOUBLE_EQ(at_one.sigma, 0.003);
  const ZoomLens half = axes.lens_at(500);
  EXPECT_DOUBLE_EQ(half.fx, 750);
  EXPECT_DOUBLE_EQ(half.fy, 751.5);
  EXPECT_DOUBLE_EQ(half.cx, 322);
  EXPECT_DOUBLE_EQ(half.distortion[0], -0.06);
  EXPECT_GT(half.sigma, 0.02);  // nobody measured there
  EXPECT_DOUBLE_EQ(axes.lens_at(-5).fx, 500);
  EXPECT_DOUBLE_EQ(axes.lens_at(9000).fx, 3000);
}

}  // namespace
}  // namespace sightline
