// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/calibration_file.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <filesystem>

#include "geometry/lenses.hpp"
#include "sightline/base/files.hpp"
#include "support/matchers.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;
using test::PoseNear;

const std::string kMatrix = R"(world_from_camera = [
  [1, 0, 0, 0.5],
  [0, 0, 1, -1.25],
  [0, -1, 0, 0.46],
  [0, 0, 0, 1],
]
)";
const std::string kGood = R"([[camera]]
name = "left"
width = 640
height = 480
model = "brown_conrady"
fx = 612.4
fy = 611.7
cx = 322.8
cy = 236
distortion = [-0.091, 0.062, 0.0006]
)" + kMatrix + R"(rms_px = 0.31
date = 2024-05-31
[camera.sigmas]
fx = 0.4
distortion = [0.001, 0.002, 0.0001]
translation = [0.001, 0.001, 0.001]
)";

/// The good calibration with its first `from` replaced.
auto with(const std::string& from, const std::string& to) {
  std::string text = kGood;
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  text.replace(at, from.size(), to);
  return parse_calibration(text, "c.toml");
}

TEST(CalibrationFile, ReadsEveryKey) {
  const auto cameras = parse_calibration(kGood, "c.toml");
  ASSERT_THAT(cameras, IsOk());
  ASSERT_EQ(cameras->size(), 1u);
  const CalibratedCamera& left = cameras->front();
  EXPECT_EQ(left.name, "left");
  EXPECT_EQ(left.model.width(), 640);
  EXPECT_EQ(left.model.parameters().cy, 236);
  EXPECT_EQ(left.model.parameters().distortion[2], 0.0006);
  EXPECT_EQ(left.model.parameters().distortion[3], 0);
  EXPECT_EQ(left.rms_px, 0.31);
  Eigen::Matrix3d r;
  r << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  EXPECT_THAT(left.world_from_camera,
              PoseNear(Rigid3(Eigen::Quaterniond(r), {0.5, -1.25, 0.46}), 1e-12, 1e-12));
  EXPECT_EQ(find_camera(*cameras, "left"), &left);
  EXPECT_EQ(find_camera(*cameras, "right"), nullptr);
}

TEST(CalibrationFile, ATimeOffsetIsKept) {
  EXPECT_EQ(parse_calibration(kGood, "c.toml")->front().time_offset_s, 0);
  const auto late = with("rms_px = 0.31\n", "rms_px = 0.31\ntime_offset_s = -0.0972\n");
  ASSERT_THAT(late, IsOk());
  EXPECT_EQ(late->front().time_offset_s, -0.0972);
  EXPECT_EQ(parse_calibration(format_calibration(*late), "c.toml")->front().time_offset_s, -0.0972);
  EXPECT_THAT(with("rms_px = 0.31\n", "time_offset_s = 3.5\n"), FailsWith("must be -2 to 2"));
  EXPECT_THAT(with("rms_px = 0.31\n", "time_offset_s = nan\n"), FailsWith("time_offset_s"));
}

TEST(CalibrationFile, AReadoutIsKept) {
  EXPECT_EQ(parse_calibration(kGood, "c.toml")->front().readout_s, 0);
  const auto rolling = with("rms_px = 0.31\n", "rms_px = 0.31\nreadout_s = -0.0213\n");
  ASSERT_THAT(rolling, IsOk());
  EXPECT_EQ(rolling->front().readout_s, -0.0213);
  EXPECT_EQ(parse_calibration(format_calibration(*rolling), "c.toml")->front().readout_s, -0.0213);
  EXPECT_THAT(with("rms_px = 0.31\n", "readout_s = 0.3\n"), FailsWith("must be -0.2 to 0.2"));
  EXPECT_THAT(with("rms_px = 0.31\n", "readout_s = \"fast\"\n"), FailsWith("readout_s"));
}

TEST(CalibrationFile, WritesWhatItReads) {
  std::vector<CalibratedCamera> cameras;
  for (const auto& [name, p] : test::lenses()) {
    Vector6 tangent;
    tangent << 0.1, -0.7, 1.3, 0.25, -1.0 / 3, 1e-5;
    const std::string plain = "camera_" + std::to_string(cameras.size());
    cameras.push_back(
        {plain, CameraModel::create(p, name).value(), Rigid3::exp(tangent), 0.1 + 0.2});
  }
  const std::filesystem::path path = testing::TempDir() + "sightline_calibration_test.toml";
  ASSERT_THAT(write_calibration(path, cameras), IsOk());
  const auto back = read_calibration(path);
  ASSERT_THAT(back, IsOk());
  ASSERT_EQ(back->size(), cameras.size());
  for (size_t i = 0; i < cameras.size(); ++i) {
    const auto& a = cameras[i].model.parameters();
    const auto& b = (*back)[i].model.parameters();
    EXPECT_EQ(cameras[i].name, (*back)[i].name);
    EXPECT_EQ(a.lens, b.lens);
    EXPECT_EQ(a.distortion, b.distortion);
    EXPECT_EQ(a.fx, b.fx);
    EXPECT_EQ(a.cy, b.cy);
    EXPECT_EQ(cameras[i].rms_px, (*back)[i].rms_px);
    EXPECT_THAT((*back)[i].world_from_camera, PoseNear(cameras[i].world_from_camera, 1e-14, 1e-14));
  }
  std::filesystem::remove(path);
}

TEST(CalibrationFile, FailedWriteLeavesTheOldFile) {
  const std::filesystem::path path = testing::TempDir() + "sightline_calibration_kept.toml";
  ASSERT_THAT(write_file_atomically(path, kGood), IsOk());
  auto cameras = parse_calibration(kGood, "c.toml").value();
  cameras.push_back(cameras[0]);  // the same name twice
  EXPECT_THAT(write_calibration(path, cameras), FailsWith("two cameras are called"));
  EXPECT_EQ(read_file(path).value(), kGood);
  std::filesystem::remove(path);
}

TEST(CalibrationFile, FlatMatrixAndVectorsMeanTheSamePose) {
  const Rigid3 pose = parse_calibration(kGood, "c")->front().world_from_camera;
  const auto flat =
      with(kMatrix, "world_from_camera = [1,0,0,0.5, 0,0,1,-1.25, 0,-1,0,0.46, 0,0,0,1]\n");
  ASSERT_THAT(flat, IsOk());
  EXPECT_THAT(flat->front().world_from_camera, PoseNear(pose, 1e-12, 1e-12));
  // OpenCV's rvec and tvec take world points into the camera.
  const Rigid3 camera_from_world = pose.inverse();
  const Eigen::AngleAxisd turn(camera_from_world.rotation);
  const Eigen::Vector3d r = turn.angle() * turn.axis();
  const Eigen::Vector3d& t = camera_from_world.translation;
  const auto vectors = with(kMatrix, fmt::format("rvec = [{}, {}, {}]\ntvec = [{}, {}, {}]\n",
                                                 r.x(), r.y(), r.z(), t.x(), t.y(), t.z()));
  ASSERT_THAT(vectors, IsOk());
  EXPECT_THAT(vectors->front().world_from_camera, PoseNear(pose, 1e-12, 1e-12));
}

TEST(CalibrationFile, EquidistantIsFisheye) {
  const auto cameras = with("brown_conrady", "equidistant");
  ASSERT_THAT(cameras, IsOk());
  EXPECT_EQ(cameras->front().model.parameters().lens, LensModel::kFisheye);
}

TEST(CalibrationFile, RefusesADeepHeader) {
  std::string text = "[a";
  for (int i = 0; i < 35000; ++i) text += ".a";
  const auto parsed = parse_calibration(text + "]\n", "calibration.toml");
  ASSERT_FALSE(parsed);
  EXPECT_EQ(parsed.error().where, "calibration.toml:1:65");
}

TEST(CalibrationFile, RefusesWrongKeysAndTypes) {
  EXPECT_THAT(with("rms_px", "rms_pixels"), FailsWith("c.toml:17:1: unknown key 'rms_pixels'"));
  EXPECT_THAT(with("fx = 612.4\n", ""), FailsWith("c.toml:1:1: camera without 'fx'"));
  EXPECT_THAT(with("612.4", "\"612.4\""),
              FailsWith("c.toml:6:6: 'fx' must hold numbers, here is text"));
  EXPECT_THAT(with("\"left\"", "7"), FailsWith("c.toml:2:8: 'name' must be text"));
  EXPECT_THAT(with("date = 2024-05-31", "date = 7"), FailsWith("c.toml:18:8: 'date' must be"));
  EXPECT_THAT(with("fy = 611.7", "fx = 611.7"), FailsWith("c.toml:7:"));
  EXPECT_THAT(with("fy = 611.7", "fy = = 1"), FailsWith("c.toml:7:"));
  EXPECT_THAT(with("[[camera]]", "rate = 3\n[[camera]]"),
              FailsWith("c.toml:1:1: unknown key 'rate'"));
  EXPECT_THAT(parse_calibration("", "c.toml"), FailsWith("c.toml: no [[camera]]"));
  EXPECT_THAT(parse_calibration("camera = 3", "c.toml"), FailsWith("c.toml:1:10: 'camera' must"));
  EXPECT_THAT(parse_calibration("camera = [1, 2]", "c.toml"), FailsWith("list of tables"));
  EXPECT_THAT(parse_calibration("camera = []", "c.toml"), FailsWith("list of tables"));
  EXPECT_THAT(parse_calibration(kGood + kGood, "c.toml"),
              FailsWith("c.toml:24:8: two cameras are called 'left'"));
  EXPECT_THAT(read_calibration("/nonexistent.toml"), FailsWith("cannot open"));
}

TEST(CalibrationFile, RefusesWrongValues) {
  EXPECT_THAT(with("612.4", "nan"), FailsWith("c.toml:6:6: 'fx' is not finite"));
  for (const char* focal : {"-612.4", "1e300", "1e-300"}) {
    EXPECT_THAT(with("612.4", focal), FailsWith("c.toml:6:6: focal lengths")) << focal;
  }
  EXPECT_THAT(with("rms_px = 0.31", "rms_px = 1e300"),
              FailsWith("c.toml:17:10: 'rms_px' is 1e+300"));
  EXPECT_THAT(with("width = 640", "width = 640.5"),
              FailsWith("c.toml:3:9: 'width' must be a whole"));
  EXPECT_THAT(with("width = 640", "width = 0"), FailsWith("c.toml:3:9: 'width' is 0"));
  EXPECT_THAT(with("brown_conrady", "brown"), FailsWith("c.toml:5:9: lens model must be"));
  EXPECT_THAT(with("0.0006]", "0.0006, 0, 0, 0]"),
              FailsWith("c.toml:10:14: 'distortion' has 6 numbers, model brown_conrady takes up"));
  EXPECT_THAT(with("\"left\"", "\"../left\""), FailsWith("c.toml:2:8: a camera's name"));
  EXPECT_THAT(with("rms_px = 0.31", "rms_px = -1"), FailsWith("c.toml:17:10: 'rms_px' is -1"));
  EXPECT_THAT(with("fx = 0.4", "fz = 0.4"), FailsWith("c.toml:20:1: unknown key 'fz' of sigmas"));
  EXPECT_THAT(with("fx = 0.4", "fx = -0.4"), FailsWith("sigma of 'fx' is negative"));
  EXPECT_THAT(with("0.002, 0.0001]", "0.002]"), FailsWith("takes 3 numbers"));
}

TEST(CalibrationFile, RefusesPosesThatAreNone) {
  EXPECT_THAT(with("[1, 0, 0, 0.5]", "[1.1, 0, 0, 0.5]"),
              FailsWith("c.toml:11:21: upper left 3x3 of the pose matrix is not a rotation"));
  EXPECT_THAT(with("[1, 0, 0, 0.5]", "[-1, 0, 0, 0.5]"), FailsWith("mirrors"));
  EXPECT_THAT(with("[1, 0, 0, 0.5]", "[1, 0, 0]"), FailsWith("c.toml:12:3: a row of"));
  EXPECT_THAT(with("  [0, 0, 0, 1],\n", ""), FailsWith("here are 12 numbers"));
  EXPECT_THAT(with("rms_px = 0.31", "rvec = [0, 0, 0]"), FailsWith("not both"));
  EXPECT_THAT(with(kMatrix, "rvec = [0, 0, 0]\n"), FailsWith("rvec without tvec"));
  EXPECT_THAT(with(kMatrix, "tvec = [0, 0, 0]\n"), FailsWith("tvec without rvec"));
  EXPECT_THAT(with(kMatrix, ""), FailsWith("camera without 'world_from_camera'"));
}

TEST(CalibrationFile, ReadsTheRecordings) {
  const std::filesystem::path recordings = SIGHTLINE_SOURCE_DIR "/../shared/recordings";
  if (!std::filesystem::exists(recordings)) GTEST_SKIP() << "no recordings beside the source";
  for (const char* name : {"bench", "bench-calibration", "toy", "board"}) {
    const auto cameras = read_calibration(recordings / name / "calibration.toml");
    ASSERT_THAT(cameras, IsOk()) << name;
    EXPECT_GE(cameras->size(), 3u);
    for (const CalibratedCamera& camera : *cameras) {
      for (double x : {0.0, 0.5, 1.0}) {
        for (double y : {0.0, 0.5, 1.0}) {
          const Eigen::Vector2d pixel(x * (camera.model.width() - 1),
                                      y * (camera.model.height() - 1));
          const auto ray = camera.model.unproject(pixel);
          ASSERT_TRUE(ray) << name << ' ' << camera.name << " at " << pixel.transpose();
          EXPECT_LT((camera.model.project(*ray).value() - pixel).norm(), 1e-6);
        }
      }
    }
  }
}

}  // namespace
}  // namespace sightline
