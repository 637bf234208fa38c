// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/opencv_camera.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "../support/matchers.hpp"
#include "sightline/calibrate/camera_file.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;
using test::PoseNear;

const Rigid3 kPose(Eigen::Quaterniond(0.9, 0.1, -0.3, 0.2), {0.3, -0.2, 1.5});

struct Written {
  cv::Mat k = (cv::Mat_<double>(3, 3) << 612.4, 0, 322.8, 0, 611.7, 236.1, 0, 0, 1);
  cv::Mat d = (cv::Mat_<double>(1, 5) << -0.09, 0.06, 0.0006, -0.0004, -0.011);
  cv::Mat rotation, translation;
  bool size = true;

  Written() {
    const Rigid3 camera_from_world = kPose.inverse();
    const Eigen::Matrix3d r = camera_from_world.rotation_matrix();
    rotation.create(3, 3, CV_64F);
    translation.create(3, 1, CV_64F);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) rotation.at<double>(i, j) = r(i, j);
      translation.at<double>(i) = camera_from_world.translation[i];
    }
  }

  /// As OpenCV itself writes it; `extension` chooses the syntax.
  std::string text(const std::string& extension = ".yml") const {
    cv::FileStorage out(extension, cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
    if (size) out << "image_width" << 640 << "image_height" << 480;
    out << "camera_matrix" << k << "distortion_coefficients" << d;
    if (!rotation.empty()) out << "R" << rotation;
    if (!translation.empty()) out << "T" << translation;
    return out.releaseAndGetString();
  }
};

TEST(OpenCvCamera, ReadsWhatOpenCvWrites) {
  for (const char* extension : {".yml", ".xml", ".json"}) {
    const auto camera = parse_opencv_camera(Written().text(extension), "c");
    ASSERT_THAT(camera, IsOk()) << extension;
    EXPECT_THAT(camera->world_from_camera, PoseNear(kPose, 1e-9, 1e-9));
    EXPECT_EQ(camera->model.width(), 640);
    EXPECT_EQ(camera->model.parameters().lens, LensModel::kBrownConrady);
    EXPECT_EQ(camera->model.parameters().distortion[4], -0.011);
    EXPECT_EQ(camera->model.parameters().cy, 236.1);
  }
}

TEST(OpenCvCamera, RotationVectorIsTheSameCamera) {
  const Vector6 tangent = Rigid3(kPose.inverse().rotation, Eigen::Vector3d::Zero()).log();
  Written written;
  written.rotation = (cv::Mat_<double>(3, 1) << tangent[0], tangent[1], tangent[2]);
  const auto camera = parse_opencv_camera(written.text(), "c");
  ASSERT_THAT(camera, IsOk());
  EXPECT_THAT(camera->world_from_camera, PoseNear(kPose, 1e-9, 1e-9));
}

TEST(OpenCvCamera, UnitScalesTheTranslationOnly) {
  Written written;
  written.translation *= 1000;
  const auto camera = parse_opencv_camera(written.text(), "c", {0, 0, 0.001});
  ASSERT_THAT(camera, IsOk());
  EXPECT_THAT(camera->world_from_camera, PoseNear(kPose, 1e-9, 1e-9));
}

TEST(OpenCvCamera, PaddedCoefficientsAndLensFamilies) {
  Written written;
  written.d = (cv::Mat_<double>(1, 14) << 1, 2, 0.1, 0.2, 3, 4, 5, 6, 0, 0, 0, 0, 0, 0);
  const auto rational = parse_opencv_camera(written.text(), "c");
  ASSERT_THAT(rational, IsOk());
  EXPECT_EQ(rational->model.parameters().lens, LensModel::kRational);
  written.d = (cv::Mat_<double>(4, 1) << -0.01, 0.002, 0, 0);
  const auto fisheye = parse_opencv_camera(written.text() + "distortion_model: equidistant\n", "c");
  ASSERT_THAT(fisheye, IsOk());
  EXPECT_EQ(fisheye->model.parameters().lens, LensModel::kFisheye);
}

TEST(OpenCvCamera, SizeMayComeFromTheImage) {
  Written written;
  written.size = false;
  EXPECT_THAT(parse_opencv_camera(written.text(), "c"), FailsWith("image_width"));
  EXPECT_EQ(parse_opencv_camera(written.text(), "c", {800, 600})->model.width(), 800);
}

TEST(OpenCvCamera, RefusesByName) {
  Written skewed;
  skewed.k.at<double>(0, 1) = 3;
  EXPECT_THAT(parse_opencv_camera(skewed.text(), "c.yml"), FailsWith("skew"));
  Written prism;
  prism.d = cv::Mat::ones(1, 12, CV_64F);
  EXPECT_THAT(parse_opencv_camera(prism.text(), "c.yml"), FailsWith("12 coefficients"));
  Written stretched;
  stretched.rotation *= 1.01;
  EXPECT_THAT(parse_opencv_camera(stretched.text(), "c.yml"), FailsWith("c.yml: R"));
  Written mirrored;
  mirrored.rotation.row(0) *= -1;
  EXPECT_THAT(parse_opencv_camera(mirrored.text(), "c.yml"), FailsWith("c.yml: R"));
  Written nowhere;
  nowhere.rotation.release();
  EXPECT_THAT(parse_opencv_camera(nowhere.text(), "c.yml"), FailsWith("no rotation"));
  Written unmoved;
  unmoved.translation.release();
  EXPECT_THAT(parse_opencv_camera(unmoved.text(), "c.yml"), FailsWith("no translation"));
  Written unfinished;
  unfinished.k.at<double>(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(parse_opencv_camera(unfinished.text(), "c.yml"), FailsWith("not finite"));
  Written absurd;
  absurd.k.at<double>(0, 0) = 1e300;
  EXPECT_THAT(parse_opencv_camera(absurd.text(), "c.yml"), FailsWith("c.yml: focal lengths"));
  EXPECT_THAT(parse_opencv_camera("fx = 3", "c.yml"), FailsWith("c.yml"));
  EXPECT_THAT(parse_opencv_camera("", "c.yml"), FailsWith("c.yml"));
  EXPECT_THAT(read_camera("/nowhere/c.yml", {}), FailsWith("/nowhere/c.yml"));
  EXPECT_THAT(read_camera("/nowhere/c.yml#left", {}), FailsWith("calibration files"));
}

}  // namespace
}  // namespace sightline
