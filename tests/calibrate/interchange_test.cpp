// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/interchange.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "../support/matchers.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;
using test::PoseNear;

CalibratedCamera camera(const std::string& name, LensModel lens, std::array<double, 8> distortion,
                        const Rigid3& place) {
  return {name,
          *CameraModel::create({.lens = lens,
                                .width = 1280,
                                .height = 720,
                                .fx = 901.25,
                                .fy = 899.5,
                                .cx = 641.75,
                                .cy = 352.125,
                                .distortion = distortion},
                               name),
          place, 0.5};
}

const Rigid3 kLeft(Eigen::Quaterniond(1, 0, 0, 0), {0, 0, 0});
const Rigid3 kRight(Eigen::Quaterniond(0.8, -0.3, 0.5, 0.1), {1.5, -0.25, 0.75});
const std::array<double, 8> kFour = {-0.11, 0.06, 0.0005, -0.0004};
const std::array<double, 8> kFive = {-0.11, 0.06, 0.0005, -0.0004, -0.01};
const std::array<double, 8> kEight = {0.3, -0.05, 0.0005, -0.0004, 0.002, 0.4, -0.02, 0.003};

void expect_round_trip(InterchangeFormat format, const std::vector<CalibratedCamera>& cameras) {
  const auto files = export_cameras(cameras, format);
  ASSERT_THAT(files, IsOk());
  const auto back = import_cameras(*files, format);
  ASSERT_THAT(back, IsOk());
  ASSERT_EQ(back->size(), cameras.size());
  for (size_t c = 0; c < cameras.size(); ++c) {
    EXPECT_EQ((*back)[c].name, cameras[c].name);
    EXPECT_THAT((*back)[c].world_from_camera, PoseNear(cameras[c].world_from_camera, 1e-7, 1e-9));
    // A lens may come back as a richer family; its images are the same.
    for (const Eigen::Vector3d& p :
         {Eigen::Vector3d(0.3, -0.2, 1), Eigen::Vector3d(-0.5, 0.3, 1.2)}) {
      EXPECT_THAT(*(*back)[c].model.project(p),
                  test::MatrixNear(*cameras[c].model.project(p), 1e-9));
    }
    EXPECT_EQ((*back)[c].model.width(), 1280);
    EXPECT_EQ((*back)[c].model.height(), 720);
  }
}

TEST(Interchange, RoundTrips) {
  using enum InterchangeFormat;
  const auto brown = LensModel::kBrownConrady;
  const std::vector<CalibratedCamera> four = {camera("left", brown, kFour, kLeft),
                                              camera("right", brown, kFour, kRight)};
  const std::vector<CalibratedCamera> five = {camera("left", brown, kFive, kRight),
                                              camera("right", brown, kFive, kLeft)};
  const std::vector<CalibratedCamera> eight = {
      camera("left", LensModel::kRational, kEight, kRight)};
  const std::vector<CalibratedCamera> fisheye = {
      camera("left", LensModel::kFisheye, {0.02, -0.01, 0.003, -0.0004}, kLeft),
      camera("right", LensModel::kFisheye, {0.02, -0.01, 0.003, -0.0004}, kRight)};
  for (const InterchangeFormat format : {kOpencv, kRos, kColmap, kMrcal, kAnipose, kCaliscope}) {
    SCOPED_TRACE(static_cast<int>(format));
    expect_round_trip(format, four);
    expect_round_trip(format, five);
    expect_round_trip(format, eight);
  }
  for (const InterchangeFormat format : {kOpencv, kRos, kColmap, kKalibr, kAnipose, kCaliscope}) {
    SCOPED_TRACE(static_cast<int>(format));
    expect_round_trip(format, fisheye);
  }
  expect_round_trip(kKalibr, four);
}

// As the format is documented, not as our exporter writes it.
TEST(Interchange, KalibrsChainGoesFromTheCameraBefore) {
  const std::string text = R"(cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.2834, 0.0739, 0.00019, 1.76e-05]
  distortion_model: radtan
  intrinsics: [458.654, 457.296, 367.215, 248.375]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.11]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [0]
  camera_model: pinhole
  distortion_coeffs: [-0.2837, 0.0745, -0.0001, -3.5e-05]
  distortion_model: radtan
  intrinsics: [457.587, 456.134, 379.999, 255.238]
  resolution: [752, 480]
  rostopic: /cam1/image_raw
)";
  const auto cameras = import_cameras({{"camchain.yaml", text}}, InterchangeFormat::kKalibr);
  ASSERT_THAT(cameras, IsOk());
  ASSERT_EQ(cameras->size(), 2u);
  EXPECT_EQ((*cameras)[1].name, "cam1");
  // Points of camera 0 move to smaller x in camera 1, which therefore stands to its right.
  EXPECT_NEAR((*cameras)[1].world_from_camera.translation.x(), 0.11, 1e-12);
  EXPECT_EQ((*cameras)[0].model.parameters().fx, 458.654);
}

TEST(Interchange, ColmapsPixelsStartAtTheEdge) {
  const std::vector<NamedText> files = {
      {"cameras.txt", "# comment\n3 PINHOLE 640 480 500 501 320 240\n"},
      {"images.txt", "1 1 0 0 0 0.5 0 2 3 north.png\n\n"}};
  const auto cameras = import_cameras(files, InterchangeFormat::kColmap);
  ASSERT_THAT(cameras, IsOk());
  EXPECT_EQ(cameras->front().name, "north");
  EXPECT_EQ(cameras->front().model.parameters().cx, 319.5);
  EXPECT_EQ(cameras->front().model.parameters().cy, 239.5);
  EXPECT_THAT(cameras->front().world_from_camera.translation,
              test::MatrixNear(Eigen::Vector3d(-0.5, 0, -2), 1e-12));
}

TEST(Interchange, MrcalsFilesHoldMoreThanWeNeed) {
  const std::string text =
      "{\n    'lensmodel':  'LENSMODEL_OPENCV8',\n\n    # intrinsics are fx,fy,cx,cy,distortion0\n"
      "    'intrinsics': [ 1761.1, 1761.2, 1965.7, 1087.5, -0.01, 0.03, -0.0002, 0.0001, 0.01, "
      "0.0, 0.0, 0.01,],\n    'valid_intrinsics_region': [\n    [ 0, 0 ],\n    [ 0, 2 ],],\n"
      "    'extrinsics': [ 0.0, 0.0, 0.0, 2.0, 0.0, 0.0,],\n    'imagersize': [ 3904, 2195,],\n"
      "    'icam_intrinsics': 0,\n\n    'optimization_inputs': "
      "b'P)h>@6aWAK2mm&gW_JJq00{}{[#',\n}\n";
  const auto cameras = import_cameras({{"0.cameramodel", text}}, InterchangeFormat::kMrcal);
  ASSERT_THAT(cameras, IsOk());
  EXPECT_EQ(cameras->front().name, "0");
  EXPECT_EQ(cameras->front().model.parameters().distortion[7], 0.01);
  EXPECT_NEAR(cameras->front().world_from_camera.translation.x(), -2, 1e-12);
}

TEST(Interchange, RefusesByName) {
  using enum InterchangeFormat;
  const auto left = camera("left", LensModel::kBrownConrady, kFive, kLeft);
  EXPECT_THAT(export_cameras({left}, kKalibr),
              FailsWith("camera left: its lens has 5 coefficients, Kalibr has room for 4"));
  EXPECT_THAT(export_cameras({camera("wide", LensModel::kFisheye, kFour, kLeft)}, kMrcal),
              FailsWith("camera wide: mrcal has no equidistant fisheye"));
  EXPECT_THAT(import_cameras({{"camchain.yaml", "cam0:\n  camera_model: omni\n"}}, kKalibr),
              FailsWith("camera_model 'omni' is not ours"));
  EXPECT_THAT(import_cameras({{"camchain.yaml", "cam0: [1, 2\n"}}, kKalibr),
              FailsWith("camchain.yaml:"));
  EXPECT_THAT(import_cameras({{"camchain.yaml", "left: 1\n"}}, kKalibr),
              FailsWith("holds no camera"));
  EXPECT_THAT(import_cameras({{"cameras.txt", "1 THIN_PRISM_FISHEYE 1 1 1\n"}, {"images.txt", ""}},
                             kColmap),
              FailsWith("cameras.txt:1: lens model 'THIN_PRISM_FISHEYE' is not ours"));
  EXPECT_THAT(
      import_cameras({{"cameras.txt", "1 PINHOLE 640 480 500 nan 320 240\n"}, {"images.txt", ""}},
                     kColmap),
      FailsWith("'nan' is not a finite number"));
  EXPECT_THAT(import_cameras({{"x.cameramodel", "{'lensmodel': 'LENSMODEL_CAHVORE'}"}}, kMrcal),
              FailsWith("LENSMODEL_CAHVORE is not ours"));
  EXPECT_THAT(import_cameras({{"left.yaml", "image_width: 640\n"}}, kRos),
              FailsWith("left.yaml:1: has no whole number 'image_height'"));
  const auto files = export_cameras({left}, kMrcal);
  ASSERT_THAT(files, IsOk());
  EXPECT_THAT(import_cameras({files->front(), files->front()}, kMrcal),
              FailsWith("two cameras are called 'left'"));
  EXPECT_THAT(parse_interchange_format("vicon"), FailsWith("opencv, kalibr, ros, colmap, mrcal"));
}

// Laid out as these programs write it, numbers made up.
TEST(Interchange, ReadsWhatAniposeAndCaliscopeWrite) {
  const std::string rest =
      "size = [ 1280, 720,]\nmatrix = [ [ 822.5, 0.0, 639.5,], [ 0.0, 823.5, 359.5,], [ 0.0, 0.0, "
      "1.0,],]\n";
  const std::string anipose =
      "[cam_0]\nname = \"A\"\n" + rest +
      "distortions = [ -0.06, 0.0, 0.0, 0.0,]\nrotation = [ 0.0, 1.5707963267948966, 0.0,]\n"
      "translation = [ -94.5, 8.5, 97.0,]\nfisheye = true\n\n[cam_1]\nname = \"B\"\n" +
      rest +
      "distortions = [ 0.1, -0.2, 0.001, 0.002, 0.05,]\nrotation = [ 0.0, 0.0, 0.0,]\n"
      "translation = [ 1.0, 2.0, 3.0,]\n\n[metadata]\nadjusted = false\nerror = 0.26\n";
  const auto cameras = import_cameras({{"calibration.toml", anipose}}, InterchangeFormat::kAnipose);
  ASSERT_THAT(cameras, IsOk());
  ASSERT_EQ(cameras->size(), 2u);
  EXPECT_EQ((*cameras)[0].name, "A");
  EXPECT_EQ((*cameras)[0].model.parameters().lens, LensModel::kFisheye);
  EXPECT_EQ((*cameras)[1].model.parameters().lens, LensModel::kBrownConrady);
  // camera_from_world turns by 90 degrees about y: (x, y, z) to (z, y, -x).
  EXPECT_THAT((*cameras)[0].world_from_camera.translation,
              test::MatrixNear(Eigen::Vector3d(97.0, -8.5, 94.5), 1e-9));
  EXPECT_THAT((*cameras)[1].world_from_camera.translation,
              test::MatrixNear(Eigen::Vector3d(-1, -2, -3), 1e-12));

  std::string caliscope;
  for (const char* id : {"10", "2", "7"}) {
    caliscope += std::string("[cameras.") + id + "]\ncam_id = " + id + "\nrotation_count = 0\n" +
                 "error = 0.45\nexposure = \"null\"\ngrid_count = 20\nignore = " +
                 (id[0] == '7' ? "true" : "false") + "\n" + rest +
                 "distortions = [0.2, -0.3, -0.004, -0.005, 0.16]\ntranslation = [0.1, 0.2, 0.9]\n"
                 "rotation = [1.6, -0.3, 0.3]\n";
  }
  const auto array =
      import_cameras({{"camera_array.toml", caliscope}}, InterchangeFormat::kCaliscope);
  ASSERT_THAT(array, IsOk());
  ASSERT_EQ(array->size(), 2u);
  EXPECT_EQ((*array)[0].name, "cam_2");
  EXPECT_EQ((*array)[1].name, "cam_10");
  EXPECT_EQ((*array)[0].rms_px, 0.45);
}

// The same; its tables go by the cameras' own names.
TEST(Interchange, ReadsWhatPose2SimWrites) {
  const auto camera = [](const std::string& name, const std::string& more) {
    return "[" + name + "]\nname = \"" + name +
           "\"\nsize = [ 1088.0, 1920.0]\nmatrix = [ [ 1681.2, 0.0, 540.5], [ 0.0, 1681.7, 961.2], "
           "[ 0.0, 0.0, 1.0]]\ndistortions = [ -0.001, 0.02, -0.0005, 0.0004]\n" +
           more + "fisheye = false\n\n";
  };
  const std::string text =
      camera("int_left_img", "rotation = [ 0.0, 0.0, 0.0]\ntranslation = [ 1.0, 2.0, 3.0]\n") +
      camera("top", "rotation = [ 0.9, 0.1, 0.2]\ntranslation = [ 0.5, 0.5, 4.0]\n") +
      "[metadata]\nadjusted = false\nerror = 0.0\n";
  const auto cameras = import_cameras({{"Calib.toml", text}}, InterchangeFormat::kAnipose);
  ASSERT_THAT(cameras, IsOk());
  ASSERT_EQ(cameras->size(), 2u);
  const auto left = std::ranges::find(*cameras, "int_left_img", &CalibratedCamera::name);
  ASSERT_NE(left, cameras->end());
  EXPECT_EQ(left->model.parameters().height, 1920);
  EXPECT_EQ(left->model.parameters().distortion[1], 0.02);
  EXPECT_THAT(left->world_from_camera.translation,
              test::MatrixNear(Eigen::Vector3d(-1, -2, -3), 1e-12));
}

TEST(Interchange, CaliscopesOlderFilesAndCamerasWithoutAPlace) {
  const auto import = [](const std::string& rest) {
    return import_cameras(
        {{"camera_array.toml",
          "[cameras.3]\ncam_id = 3\nsize = [1280, 720]\nrotation_count = 0\nmatrix = [[822.5, "
          "0.0, 639.5], [0.0, 823.5, 359.5], [0.0, 0.0, 1.0]]\ndistortions = [0.2, -0.3, -0.004, "
          "-0.005, 0.16]\nfisheye = false\n" +
              rest}},
        InterchangeFormat::kCaliscope);
  };
  // By 90 degrees about y: (x, y, z) to (z, y, -x).
  const auto turned = import(
      "translation = [[0.0], [0.0], [2.0]]\nrotation = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, "
      "0.0, 0.0]]\n");
  ASSERT_THAT(turned, IsOk());
  EXPECT_THAT(turned->front().world_from_camera.translation,
              test::MatrixNear(Eigen::Vector3d(2, 0, 0), 1e-12));
  EXPECT_THAT(import("translation = [0.0, 0.0, 2.0]\nrotation = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], "
                     "[1.0, 0.0, 0.0]]\n"),
              FailsWith("is no rotation matrix"));
  EXPECT_THAT(import("translation = [0.0, 0.0, 2.0]\nrotation = [1.0, 2.0]\n"),
              FailsWith("has 2 numbers, not 3"));
  EXPECT_THAT(import("error = 0.3\n"), FailsWith("has been given no place"));
}

TEST(Interchange, RefusesBrokenTomlByPlace) {
  const auto import = [](const std::string& text) {
    return import_cameras({{"a.toml", text}}, InterchangeFormat::kAnipose);
  };
  EXPECT_THAT(import("[cam_0\n"), FailsWith("a.toml:1"));
  EXPECT_THAT(import("[metadata]\nerror = 1.0\n"), FailsWith("holds no camera"));
  EXPECT_THAT(import("[cam_0]\nname = \"A\"\nsize = [4]\n"), FailsWith("'size' has 1 numbers"));
  EXPECT_THAT(import("[cam_0]\nsize = [4, 3]\nmatrix = [[1.0, 0.5, 2.0], [0.0, 1.0, 1.0], [0.0, "
                     "0.0, 1.0]]\ndistortions = []\n"),
              FailsWith("'matrix' is no"));
  EXPECT_THAT(import("[cam_0]\nsize = [4, nan]\n"), FailsWith("no finite number"));
  const std::string rest =
      "size = [4, 3]\nmatrix = [[4.0, 0.0, 2.0], [0.0, 4.0, 1.0], [0.0, 0.0, 1.0]]\n"
      "distortions = [0.0]\nrotation = [0.0, 0.0, 0.0]\n";
  EXPECT_THAT(import("[cam_0]\n" + rest + "translation = [1e300, 1e300, 0.0]\n"),
              FailsWith("is no place of a camera"));
  const auto odd =
      import("[cam_0]\nname = \"a\\\"\\n\\\\b\"\n" + rest + "translation = [0.0, 0.0, 0.0]\n");
  ASSERT_THAT(odd, IsOk());
  const auto back = import(export_cameras(*odd, InterchangeFormat::kAnipose)->front().text);
  ASSERT_THAT(back, IsOk());
  EXPECT_EQ(back->front().name, "a\"\n\\b");
}

}  // namespace
}  // namespace sightline
