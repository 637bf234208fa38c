// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "../support/matchers.hpp"
#include "sightline/calibrate/place_world.hpp"
#include "synthetic_views.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;
using test::make_rig;
using test::Random;
using test::SyntheticRig;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kNoise_px = 0.2;

/// What the rig sees of a target that faces its first camera (whose frame is the world) and is
/// moved to `place(0)`, ..., by which its top-left corner is off the start.
CalibrationViews moved_target(const SyntheticRig& rig, int sets,
                              const std::function<Eigen::Vector3d(int)>& place, uint64_t seed) {
  Random random(seed);
  CalibrationViews views{rig.views.target, rig.views.cameras, static_cast<size_t>(sets), {}};
  for (int set = 0; set < sets; ++set) {
    const Eigen::Vector3d start(-0.35, -0.14, 1.4);
    for (size_t c = 0; c < rig.truth.size(); ++c) {
      TargetView view{c, static_cast<size_t>(set), 0, {}, fmt::format("set {}", set)};
      const Rigid3 camera_from_world = rig.truth[c].world_from_camera.inverse();
      for (int id = 0; id < views.target.corner_count(); ++id) {
        const Eigen::Vector2d p = views.target.corner(id);
        const auto pixel = rig.truth[c].model.project(
            camera_from_world * (start + place(set) + Eigen::Vector3d(p.x(), p.y(), 0)));
        if (!pixel) continue;
        const Eigen::Vector2d noisy = *pixel + kNoise_px * random.normal<2>();
        if (!rig.truth[c].model.contains(noisy)) continue;
        view.corners.push_back({id, noisy, Eigen::Vector2d::Zero()});
      }
      if (view.corners.size() >= 12) views.views.push_back(std::move(view));
    }
  }
  return views;
}

const Eigen::Vector3d kWay = Eigen::Vector3d(1, 0.2, 0.3).normalized();

/// Along kWay, `length` in all.
std::function<Eigen::Vector3d(int)> straight(double length, int sets) {
  return [=](int set) -> Eigen::Vector3d { return length * set / (sets - 1) * kWay; };
}

double angle_deg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) / kDegree;
}

TEST(WorldOfMotion, TheAxisIsTheWayThatTheTargetWent) {
  const SyntheticRig rig = make_rig({.cameras = 2, .sets = 4});
  for (const auto& [name, index, sign] :
       {std::tuple("x", 0, 1), {"-x", 0, -1}, {"y", 1, 1}, {"-y", 1, -1}, {"z", 2, 1}}) {
    const auto axis = parse_world_axis(name);
    ASSERT_THAT(axis, IsOk());
    double squared = 0;
    constexpr int kRuns = 12;
    for (uint64_t seed = 1; seed <= kRuns; ++seed) {
      const auto views = moved_target(rig, 15, straight(0.3, 15), seed);
      const auto placed = world_of_motion(views, rig.truth, *axis, 0.3);
      ASSERT_THAT(placed, IsOk()) << name;
      const Rigid3 new_from_old =
          placed->cameras[0].world_from_camera * rig.truth[0].world_from_camera.inverse();
      const Eigen::Vector3d went = sign * (new_from_old.rotation * kWay);
      const double off = angle_deg(went, Eigen::Vector3d::Unit(index));
      EXPECT_LT(off, 0.3) << name;
      squared += off * off / (2 * placed->sigma_deg * placed->sigma_deg);
      EXPECT_NEAR(placed->travel, 0.3, 0.003);
      EXPECT_EQ(placed->places, 15u);
      // Nothing but a turn: the rig is the same, and so is the origin.
      EXPECT_THAT(
          placed->cameras[0].world_from_camera.inverse() * placed->cameras[1].world_from_camera,
          test::PoseNear(rig.truth[0].world_from_camera.inverse() * rig.truth[1].world_from_camera,
                         1e-9, 1e-9));
      EXPECT_LT((new_from_old * Eigen::Vector3d::Zero()).norm(), 1e-12);
      // z stays as near as it can: in the plane of the axis and of what it was.
      const Eigen::Vector3d up = new_from_old.rotation * Eigen::Vector3d::UnitZ();
      if (index != 2) {
        EXPECT_NEAR(up[1 - index], 0, 1e-9);
        EXPECT_GT(up.z(), 0.9);
        EXPECT_NEAR(placed->up_turned_deg, angle_deg(up, Eigen::Vector3d::UnitZ()), 1e-6);
      }
    }
    // Inside of what is claimed: mean square of two axes' errors over their sigmas.
    EXPECT_LT(squared / kRuns, 2.5) << name;
    EXPECT_GT(squared / kRuns, 0.25) << name;
  }
  EXPECT_THAT(parse_world_axis("up"), FailsWith("'up' is not x, y, z, -x, -y or -z"));
  EXPECT_THAT(parse_world_axis("-"), FailsWith("is not x, y, z"));
}

TEST(WorldOfMotion, OneCameraIsEnough) {
  const SyntheticRig rig = make_rig({.cameras = 1, .sets = 4});
  const auto views = moved_target(rig, 15, straight(0.3, 15), 5);
  const auto placed = world_of_motion(views, rig.truth, {0, 1}, std::nullopt);
  ASSERT_THAT(placed, IsOk());
  EXPECT_LT(
      angle_deg(placed->cameras[0].world_from_camera.rotation * kWay, Eigen::Vector3d::UnitX()),
      0.5);
}

TEST(WorldOfMotion, RefusesByName) {
  const SyntheticRig rig = make_rig({.cameras = 2, .sets = 4});
  const auto refused = [&](int sets, const std::function<Eigen::Vector3d(int)>& place,
                           WorldAxis axis = {0, 1}, std::optional<double> length = {}) {
    return world_of_motion(moved_target(rig, sets, place, 1), rig.truth, axis, length);
  };
  EXPECT_THAT(refused(4, straight(0.3, 4)), FailsWith("at 4 places, 5 or more are needed"));
  EXPECT_THAT(refused(10, straight(0.02, 10)), FailsWith("mm only, 50 mm or more are needed"));
  EXPECT_THAT(refused(20,
                      [](int set) -> Eigen::Vector3d {
                        return 0.3 * (set < 10 ? set : 19 - set) / 10.0 * kWay;
                      }),
              FailsWith("went back and forth over"));
  // An arc of 20 degrees with a radius of a meter.
  EXPECT_THAT(refused(15,
                      [](int set) {
                        const double turn = 20 * kDegree * set / 14;
                        return Eigen::Vector3d(std::sin(turn), 0.3 * (1 - std::cos(turn)),
                                               0.9 * (1 - std::cos(turn)));
                      }),
              FailsWith("the way is curved: an arc that rises by"));
  EXPECT_THAT(refused(16,
                      [](int set) -> Eigen::Vector3d {
                        return 0.02 * set * kWay + Eigen::Vector3d(0, set % 2 * 0.02, 0);
                      }),
              FailsWith("the way is not straight"));
  EXPECT_THAT(refused(10, straight(0.3, 10), {0, 1}, 0.33), FailsWith("the rig measures 300"));
  EXPECT_THAT(refused(10,
                      [](int set) -> Eigen::Vector3d {
                        return 0.03 * set * Eigen::Vector3d(0.1, 0, 1).normalized();
                      }),
              FailsWith("deg from the world's z: x cannot be that"));
  // The image's y axis is down: up is against it.
  const auto down = [](int set) -> Eigen::Vector3d { return {0, 0.02 * set, 0}; };
  EXPECT_THAT(refused(10, down, {2, 1}), FailsWith("upside down: was the target moved downwards"));
  EXPECT_THAT(refused(10, down, {2, -1}), IsOk());
}

}  // namespace
}  // namespace sightline
