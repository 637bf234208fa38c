// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <numbers>

#include "sightline/calibrate/calibration_file.hpp"
#include "support/matchers.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;
using test::PoseNear;

const std::string kIdentity = "[[1,0,0,0], [0,1,0,0], [0,0,1,0], [0,0,0,1]]";
const std::string kGood = R"([[camera]]
name = "head"
width = 640
height = 480
model = "brown_conrady"
fx = 500
fy = 501
cx = 320
cy = 240
distortion = [-0.1]
[camera.axes]
world_from_base = [[1,0,0,0.5], [0,1,0,-1.25], [0,0,1,2], [0,0,0,1]]
pan_from_tilt = [[1,0,0,0.01], [0,1,0,0], [0,0,1,0.06], [0,0,0,1]]
tilt_from_camera = [[1,0,0,0], [0,0,1,0.03], [0,-1,0,0], [0,0,0,1]]
pan_scale = -1
tilt_scale = 0.5
latency_s = 0.04
latency_sigma_s = 0.002
sigma_deg = 0.02
backlash_deg = 0.1
max_rate_deg_s = 120
acceleration_deg_s2 = 300
stale_s = 0.2
[[camera.axes.zoom]]
setting = 0
fx = 500
fy = 501
cx = 320
cy = 240
distortion = [-0.1]
sigma = 0.001
[[camera.axes.zoom]]
setting = 1000
fx = 1500
fy = 1502
cx = 321
cy = 241
sigma = 0.002
)";

Result<std::vector<CalibratedCamera>> with(const std::string& from, const std::string& to) {
  std::string text = kGood;
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  text.replace(at, from.size(), to);
  return parse_calibration(text, "c.toml");
}

TEST(CameraAxesFile, ReadsEveryKey) {
  const auto cameras = parse_calibration(kGood, "c.toml");
  ASSERT_THAT(cameras, IsOk());
  const CalibratedCamera& head = cameras->front();
  ASSERT_TRUE(head.axes);
  const CameraAxes& axes = *head.axes;
  constexpr double kDegree = std::numbers::pi / 180;
  EXPECT_EQ(axes.world_from_base.translation, Eigen::Vector3d(0.5, -1.25, 2));
  EXPECT_EQ(axes.pan_scale, -1);
  EXPECT_EQ(axes.tilt_scale, 0.5);
  EXPECT_EQ(axes.latency_s, 0.04);
  EXPECT_EQ(axes.latency_sigma_s, 0.002);
  EXPECT_DOUBLE_EQ(axes.sigma, 0.02 * kDegree);
  EXPECT_DOUBLE_EQ(axes.backlash, 0.1 * kDegree);
  EXPECT_DOUBLE_EQ(axes.max_rate, 120 * kDegree);
  EXPECT_DOUBLE_EQ(axes.acceleration, 300 * kDegree);
  EXPECT_EQ(axes.stale_s, 0.2);
  ASSERT_EQ(axes.zoom.size(), 2u);
  EXPECT_EQ(axes.zoom[1].setting, 1000);
  EXPECT_EQ(axes.zoom[1].fy, 1502);
  EXPECT_EQ(axes.zoom[0].distortion[0], -0.1);
  // At rest it stands where its axes say.
  EXPECT_THAT(head.world_from_camera, PoseNear(axes.world_from_camera(0, 0), 1e-14, 1e-14));
  EXPECT_NEAR(head.world_from_camera.translation.z(), 2.06, 1e-12);
}

TEST(CameraAxesFile, WhatIsWrittenReadsBack) {
  auto cameras = parse_calibration(kGood, "c.toml").value();
  cameras.push_back(cameras.front());
  cameras.back().name = "fixed";
  cameras.back().axes.reset();
  for (const std::string& text :
       {format_calibration(cameras),
        format_calibration(cameras, {CalibrationSigmas{}, CalibrationSigmas{}}, "2026-11-24",
                           "")}) {
    const auto back = parse_calibration(text, "again.toml");
    ASSERT_THAT(back, IsOk()) << text;
    ASSERT_TRUE((*back)[0].axes);
    EXPECT_FALSE((*back)[1].axes);
    const CameraAxes &a = *cameras[0].axes, &b = *(*back)[0].axes;
    EXPECT_THAT(b.world_from_base, PoseNear(a.world_from_base, 1e-14, 1e-14));
    EXPECT_THAT(b.tilt_from_camera, PoseNear(a.tilt_from_camera, 1e-14, 1e-14));
    EXPECT_EQ(a.zoom, b.zoom);
    EXPECT_DOUBLE_EQ(a.sigma, b.sigma);
    EXPECT_DOUBLE_EQ(a.acceleration, b.acceleration);
    EXPECT_EQ(a.pan_scale, b.pan_scale);
    EXPECT_EQ(a.latency_s, b.latency_s);
  }
}

TEST(CameraAxesFile, RefusesWhatIsWrongAndSaysWhere) {
  EXPECT_THAT(with("pan_scale", "pan_skale"), FailsWith("c.toml:15:1"));
  EXPECT_THAT(with("pan_scale", "pan_skale"), FailsWith("unknown key 'pan_skale' of axes"));
  EXPECT_THAT(with("pan_scale = -1", "pan_scale = 0"), FailsWith("'pan_scale' must not be zero"));
  EXPECT_THAT(with("latency_s = 0.04", "latency_s = 4"), FailsWith("it must be 0 to 0.5"));
  EXPECT_THAT(with("latency_s = 0.04", "latency_s = nan"), FailsWith("not finite"));
  EXPECT_THAT(with("latency_s = 0.04", "latency_s = \"x\""), FailsWith("here is text"));
  EXPECT_THAT(with("world_from_base = [[1", "world_from_base = [[2"), FailsWith("c.toml:12"));
  EXPECT_THAT(with("[0,0,0,1]]\npan_scale", "[0,0,0]]\npan_scale"), FailsWith("this one 3"));
  EXPECT_THAT(with("setting = 1000", "setting = 0"), FailsWith("must grow"));
  EXPECT_THAT(with("fx = 1500", "fx = -1"), FailsWith("'fx' and 'fy' above 0"));
  EXPECT_THAT(with("cx = 321", "cz = 321"), FailsWith("unknown key 'cz' of a zoom setting"));
  EXPECT_THAT(with("sigma = 0.002", "distortion = [1,2,3,4,5,6]"), FailsWith("takes 5"));
  EXPECT_THAT(with("distortion = [-0.1]\n[camera.axes]",
                   "distortion = [-0.1]\nworld_from_camera = " + kIdentity + "\n[camera.axes]"),
              FailsWith("its axes say where it stands"));
  EXPECT_THAT(with("[camera.axes]\nworld_from_base", "[camera.axes]\nworld_from_bass"),
              FailsWith("unknown key"));
  const size_t axes = kGood.find("[camera.axes]");
  EXPECT_THAT(parse_calibration(kGood.substr(0, axes) + "axes = 3\n", "c.toml"),
              FailsWith("must be a table"));
  EXPECT_THAT(parse_calibration(kGood.substr(0, axes) + "[camera.axes]\nlatency_s = 0\n", "c.toml"),
              FailsWith("axes without"));
}

}  // namespace
}  // namespace sightline
