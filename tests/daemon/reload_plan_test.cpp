// SPDX-License-Identifier: Apache-2.0
#include "system/reload_plan.hpp"

#include <gtest/gtest.h>

namespace sightline {
namespace {

using Camera = ReloadPlan::Camera;

Installation cameras(const std::vector<std::string>& names) {
  CameraModel::Parameters lens;
  lens.width = 64;
  lens.height = 48;
  lens.fx = lens.fy = 60;
  Installation installation;
  for (const std::string& name : names) {
    const CalibratedCamera camera{name, *CameraModel::create(lens, name), {}, 0.3};
    installation.cameras.push_back(CameraConfig{.name = name,
                                                .recording = {},
                                                .recorded_as = {},
                                                .calibration = camera,
                                                .overlay = {},
                                                .place = {}});
  }
  return installation;
}

ReloadPlan plan(const Installation& before, const Installation& after,
                const std::vector<std::string>& fusion_cameras) {
  return plan_reload(before, after, compare(before, after), fusion_cameras);
}

TEST(ReloadPlan, NothingThatStaysIsTouchedByACameraThatComes) {
  const ReloadPlan made = plan(cameras({"a", "b"}), cameras({"a", "b", "c"}), {"a", "b"});
  EXPECT_EQ(made.cameras, (std::vector{Camera::kKeep, Camera::kKeep, Camera::kRestart}));
  EXPECT_FALSE(made.fusion) << "objects keep their poses";
  EXPECT_FALSE(made.observers);
  EXPECT_TRUE(made.rig && made.search && made.points && made.views) << "they see all cameras";
}

TEST(ReloadPlan, ObjectsKeepTheirPosesWhenTheLastCameraGoes) {
  const ReloadPlan made = plan(cameras({"a", "b"}), cameras({"a"}), {"a", "b"});
  EXPECT_EQ(made.cameras, (std::vector{Camera::kKeep}));
  EXPECT_FALSE(made.fusion);
}

TEST(ReloadPlan, AnotherCameraUnderAnOldIdMakesTheEstimatorsAnew) {
  // "b" went in an earlier reload; what was learned of it is not true of "c".
  EXPECT_TRUE(plan(cameras({"a"}), cameras({"a", "c"}), {"a", "b"}).fusion);
  EXPECT_FALSE(plan(cameras({"a"}), cameras({"a", "b"}), {"a", "b"}).fusion);
  const ReloadPlan moved = plan(cameras({"a", "b"}), cameras({"b"}), {"a", "b"});
  EXPECT_TRUE(moved.fusion);
  EXPECT_EQ(moved.cameras, (std::vector{Camera::kRestart}));
}

TEST(ReloadPlan, AnOverlayAloneRestylesItsCamera) {
  const Installation before = cameras({"a", "b"});
  Installation after = before;
  after.cameras[1].overlay.halo_opacity = 0.125f;
  const ReloadPlan made = plan(before, after, {"a", "b"});
  EXPECT_EQ(made.cameras, (std::vector{Camera::kKeep, Camera::kRestyle}));
  EXPECT_FALSE(made.rig || made.fusion || made.search || made.recorder || made.rtsp || made.http);
}

}  // namespace
}  // namespace sightline
