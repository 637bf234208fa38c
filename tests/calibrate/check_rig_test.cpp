// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/check_rig.hpp"

#include <gtest/gtest.h>

#include "../support/matchers.hpp"
#include "sightline/calibrate/place_world.hpp"
#include "synthetic_views.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;
using test::make_rig;
using test::PoseNear;
using test::SyntheticRig;

constexpr double kDegree = 0.017453292519943295;

Rigid3 bump() {
  Vector6 d;
  d << 0.1 * kDegree, 0, 0, 0, 0.002, 0;
  return Rigid3::exp(d);
}

TEST(CheckRig, AnUntouchedRigIsInOrder) {
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    const SyntheticRig rig = make_rig({.cameras = 4, .sets = 48, .seed = seed});
    const auto check = check_rig(rig.views, rig.truth);
    ASSERT_THAT(check, IsOk());
    EXPECT_TRUE(check->in_order) << "seed " << seed;
    ASSERT_TRUE(check->held_out_px);
    EXPECT_LT(*check->held_out_px, 0.9);  // noise of 0.28 px and that of a pose from one camera
  }
}

// A target in motion before rolling shutters, whose read-outs the calibration has or lacks.
TEST(CheckRig, KnowsTheReadoutOfRollingShutters) {
  const SyntheticRig rig = make_rig(
      {.cameras = 3, .sets = 48, .speed = 0.4, .turn = 0.8, .readout_s = 0.028, .seed = 4});
  const auto rolling = check_rig(rig.views, rig.truth);
  ASSERT_THAT(rolling, IsOk());
  EXPECT_TRUE(rolling->in_order);
  std::vector<CalibratedCamera> global = rig.truth;
  for (CalibratedCamera& camera : global) camera.readout_s = 0;
  const auto all_at_once = check_rig(rig.views, global);
  ASSERT_THAT(all_at_once, IsOk());
  EXPECT_LT(*rolling->held_out_px, 0.9);
  EXPECT_GT(*all_at_once->held_out_px, 2 * *rolling->held_out_px);
  EXPECT_GT(all_at_once->rigidity->rms_mm, 2 * rolling->rigidity->rms_mm);
}

// 0.1 degrees and 2 mm, of any camera, also of the one whose frame is the world's.
TEST(CheckRig, FindsTheCameraThatWasBumped) {
  for (size_t bumped = 0; bumped < 4; ++bumped) {
    SyntheticRig rig = make_rig({.cameras = 4, .sets = 48, .seed = 3});
    std::vector<CalibratedCamera> calibration = rig.truth;
    // The calibration is of before: today the camera stands at calibrated * bump.
    calibration[bumped].world_from_camera = rig.truth[bumped].world_from_camera * bump().inverse();
    const auto check = check_rig(rig.views, calibration);
    ASSERT_THAT(check, IsOk());
    EXPECT_FALSE(check->in_order);
    for (size_t c = 0; c < 4; ++c) {
      EXPECT_EQ(check->cameras[c].moved, c == bumped) << c << " " << check->cameras[c].words;
    }
    const CameraDrift& found = check->cameras[bumped];
    EXPECT_NEAR(found.rotation_deg, 0.1, 4 * found.rotation_sigma_deg);
    EXPECT_NEAR(found.shift_mm, 2, 4 * found.shift_sigma_mm);
    EXPECT_NE(found.words.find("turned 0."), std::string::npos);
    EXPECT_THAT(check->now[bumped].world_from_camera,
                PoseNear(rig.truth[bumped].world_from_camera, 1.2e-3, 2e-3));
  }
}

TEST(CheckRig, RefusesExchangedAndUnknownCameras) {
  const SyntheticRig rig = make_rig({.cameras = 3, .sets = 36});
  std::vector<CalibratedCamera> calibration = rig.truth;
  std::swap(calibration[1].name, calibration[2].name);
  EXPECT_THAT(check_rig(rig.views, calibration), FailsWith("cam1 and cam2 are exchanged"));
  calibration = rig.truth;
  calibration.pop_back();
  EXPECT_THAT(check_rig(rig.views, calibration),
              FailsWith("camera cam2: is not in the calibration in force"));
}

TEST(PlaceWorld, TargetOnTheFloor) {
  // Half of the poses of the target in the camera's frame are "above": x right, y up, z out.
  const SyntheticRig rig = make_rig({.cameras = 2, .sets = 20});
  const auto placed = world_of_target(rig.views, rig.truth);
  ASSERT_THAT(placed, IsOk());
  const auto solution = solve_rig(rig.views, {});
  ASSERT_THAT(solution, IsOk());
  const size_t set = rig.views.views.front().set;
  const Rigid3 half_turn(Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero());
  const Rigid3 old_from_new = *solution->world_from_target[set] * half_turn;
  for (size_t c = 0; c < 2; ++c) {
    EXPECT_GT(placed->cameras[c].world_from_camera.translation.z(), 0.3) << "above the floor";
    EXPECT_THAT(placed->cameras[c].world_from_camera,
                PoseNear(old_from_new.inverse() * rig.truth[c].world_from_camera, 0.02, 0.02));
  }
  EXPECT_THAT(placed->cameras[0].world_from_camera.inverse() * placed->cameras[1].world_from_camera,
              PoseNear(rig.truth[0].world_from_camera.inverse() * rig.truth[1].world_from_camera,
                       1e-9, 1e-9));
}

std::vector<SurveyedSight> sights_of(const SyntheticRig& rig, const Rigid3& world_from_rig,
                                     double scale) {
  std::vector<SurveyedSight> sights;
  for (const Eigen::Vector3d& p :
       {Eigen::Vector3d(0, 0, 1.2), {0.2, 0.1, 1.3}, {-0.2, 0.1, 1.1}, {0.1, -0.2, 1.4}}) {
    const Eigen::Vector3d in_rig = rig.truth[0].world_from_camera * p;
    for (const CalibratedCamera& camera : rig.truth) {
      const auto pixel = camera.model.project(camera.world_from_camera.inverse() * in_rig);
      if (pixel) sights.push_back({camera.name, scale * (world_from_rig * in_rig), *pixel});
    }
  }
  return sights;
}

TEST(PlaceWorld, SurveyedPoints) {
  const SyntheticRig rig = make_rig({.cameras = 2, .sets = 2});
  const Rigid3 world_from_rig(Eigen::Quaterniond(0.6, 0.2, -0.7, 0.3), {3, -2, 1});
  const auto placed = world_of_points(sights_of(rig, world_from_rig, 1), rig.truth);
  ASSERT_THAT(placed, IsOk());
  EXPECT_EQ(placed->points, 4u);
  EXPECT_NEAR(placed->scale, 1, 1e-6);
  EXPECT_LT(placed->rms_mm, 0.01);
  for (size_t c = 0; c < 2; ++c) {
    EXPECT_THAT(placed->cameras[c].world_from_camera,
                PoseNear(world_from_rig * rig.truth[c].world_from_camera, 1e-4, 1e-4));
  }
  EXPECT_THAT(world_of_points(sights_of(rig, world_from_rig, 1.05), rig.truth),
              FailsWith("the world is 1.05"));
  auto few = sights_of(rig, world_from_rig, 1);
  few.resize(4);
  EXPECT_THAT(world_of_points(few, rig.truth), FailsWith("three or more are needed"));
}

TEST(PlaceWorld, FilesOfPoints) {
  const auto sights =
      parse_surveyed_points("x,y,z,camera,u,v\n0,0,1.5,left,320.5,240\n", "points.csv");
  ASSERT_THAT(sights, IsOk());
  ASSERT_EQ(sights->size(), 1u);
  EXPECT_EQ(sights->front().camera, "left");
  EXPECT_EQ(sights->front().pixel, Eigen::Vector2d(320.5, 240));
  EXPECT_THAT(parse_surveyed_points("x,y\n", "points.csv"), FailsWith("points.csv:1"));
  EXPECT_THAT(parse_surveyed_points("x,y,z,camera,u,v\n0,0,nan,left,1,2\n", "points.csv"),
              FailsWith("points.csv:2: 'nan' is not a number"));
}

}  // namespace
}  // namespace sightline
