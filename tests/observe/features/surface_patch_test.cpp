// SPDX-License-Identifier: Apache-2.0
#include "observe/terms/surface_patch.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "observe/print_scene.hpp"
#include "support/matchers.hpp"
#include "support/random.hpp"

namespace sightline::observe {
namespace {

using test::PoseNear;
using test::Random;

constexpr double kDegree = std::numbers::pi / 180;

// A patch of an object before a camera, and what its camera sees of it.
struct Sight {
  explicit Sight(Random& random, LensModel lens = LensModel::kBrownConrady, double distance = 0.5)
      : camera(test::test_camera(lens)) {
    pose.rotation = Eigen::Quaterniond(
        Eigen::AngleAxisd(random.uniform(0, 3), random.normal<3>().normalized()));
    const Eigen::Vector2d pixel(random.uniform(200, 440), random.uniform(150, 330));
    seen = image_patch(camera.model, pixel, random.uniform(-3, 3), random.uniform(15, 40)).value();
    const Eigen::Vector3d here = distance * seen.ray;
    const Eigen::Vector3d tilted =
        (-seen.ray + Eigen::Vector3d(random.uniform(-0.6, 0.6), random.uniform(-0.6, 0.6), 0))
            .normalized();
    const SurfacePatch as_seen = surface_patch(seen, tilted, distance);
    pose.translation = here - pose.rotation * point;
    patch = {pose.rotation.inverse() * as_seen.seen_from, pose.rotation.inverse() * as_seen.normal,
             pose.rotation.inverse() * as_seen.direction, as_seen.size};
  }
  CalibratedCamera camera;
  Eigen::Vector3d point{0.03, -0.02, 0.01};
  Rigid3 pose;  // camera_from_object
  ImagePatch seen;
  SurfacePatch patch;
};

TEST(SurfacePatch, ItsPoseIsWhereItWasSeen) {
  for (const LensModel lens : {LensModel::kBrownConrady, LensModel::kFisheye}) {
    for (uint64_t seed = 1; seed <= 20; ++seed) {
      Random random(seed);
      const Sight sight(random, lens);
      EXPECT_NEAR(sight.patch.direction.dot(sight.patch.normal), 0, 1e-9);
      const auto [as_trained, mirrored] = patch_poses(sight.patch, sight.point, sight.seen);
      EXPECT_THAT(as_trained, PoseNear(sight.pose, 1e-6, 1e-9)) << seed;
      // The other one has the patch at the same place, as large, and tilted to the other side.
      EXPECT_LT((mirrored * sight.point - sight.pose * sight.point).norm(), 1e-9);
      const auto tilt = [&](const Rigid3& pose) -> Eigen::Vector3d {
        return pose.rotation * sight.patch.normal;
      };
      EXPECT_LT((tilt(mirrored) + tilt(sight.pose)).cross(sight.seen.ray).norm(), 1e-6) << seed;
    }
  }
}

// Far away a small plane at either pose shows the same: its points lie at the same pixels.
TEST(SurfacePatch, BothPosesShowTheSameFromAfar) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    Random random(seed);
    const Sight sight(random, LensModel::kBrownConrady, 5);
    const auto poses = patch_poses(sight.patch, sight.point, sight.seen);
    const Eigen::Vector3d across = sight.patch.normal.cross(sight.patch.direction);
    for (int i = 0; i < 8; ++i) {
      const double a = i * 45 * kDegree;
      const Eigen::Vector3d beside =
          sight.point + 0.02 * (std::cos(a) * sight.patch.direction + std::sin(a) * across);
      EXPECT_LT((*sight.camera.model.project(poses[0] * beside) -
                 *sight.camera.model.project(poses[1] * beside))
                    .norm(),
                0.05)
          << seed;
    }
  }
}

TEST(SurfacePatch, LooksAsItDidUntilItIsTurnedMovedOrSeenFromBehind) {
  Random random(7);
  const Sight sight(random);
  const PatchTolerance tolerance{0.5, 1.5, 0.2};
  const auto looks = [&](const Eigen::Quaterniond& turn, double times) {
    const Eigen::Matrix3d rotation = (turn * sight.pose.rotation).toRotationMatrix();
    return looks_like(sight.patch, rotation, times * (sight.pose * sight.point), sight.seen,
                      tolerance);
  };
  const auto about_ray = [&](double angle) {
    return Eigen::Quaterniond(Eigen::AngleAxisd(angle, sight.seen.ray));
  };
  EXPECT_TRUE(looks(about_ray(0), 1));
  EXPECT_TRUE(looks(about_ray(0.45), 1));
  EXPECT_FALSE(looks(about_ray(0.55), 1));
  EXPECT_FALSE(looks(about_ray(-0.55), 1));
  EXPECT_TRUE(looks(about_ray(0), 1.45));
  EXPECT_FALSE(looks(about_ray(0), 1.55));
  EXPECT_TRUE(looks(about_ray(0), 0.7));
  EXPECT_FALSE(looks(about_ray(0), 0.6));
  const Eigen::Quaterniond behind(
      Eigen::AngleAxisd(std::numbers::pi, sight.seen.direction));  // its orientation stays
  EXPECT_FALSE(looks(behind, 1));
}

TEST(SurfacePatch, NothingIsSeenBeyondTheLens) {
  const CalibratedCamera camera = test::test_camera(LensModel::kFisheye);
  EXPECT_FALSE(image_patch(camera.model, {1e6, 1e6}, 0, 31));
}

}  // namespace
}  // namespace sightline::observe
