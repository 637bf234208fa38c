// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>
#include <random>
#include <vector>

#include "lenses.hpp"
#include "sightline/geometry/camera_model.hpp"

namespace sightline {
namespace {

cv::Mat distortion_of(const CameraModel::Parameters& p) {
  const int count = p.lens == LensModel::kFisheye ? 4 : p.lens == LensModel::kRational ? 8 : 5;
  cv::Mat k(count, 1, CV_64F);
  for (int i = 0; i < count; ++i) k.at<double>(i) = p.distortion[static_cast<size_t>(i)];
  return k;
}

TEST(CameraModel, AgreesWithOpenCv) {
  std::mt19937 rng(11);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const auto& [name, p] : test::lenses()) {
    const CameraModel camera = CameraModel::create(p, name).value();
    std::vector<cv::Point3d> points;
    std::vector<Eigen::Vector2d> ours;
    while (points.size() < 500) {
      const Eigen::Vector3d point(0.8 * unit(rng), 0.6 * unit(rng), 1 + 0.4 * unit(rng));
      const auto pixel = camera.project(point);
      if (!pixel) continue;
      points.emplace_back(point.x(), point.y(), point.z());
      ours.push_back(*pixel);
    }
    const cv::Matx33d k(p.fx, 0, p.cx, 0, p.fy, p.cy, 0, 0, 1);
    const cv::Vec3d none(0, 0, 0);
    std::vector<cv::Point2d> theirs;
    if (p.lens == LensModel::kFisheye) {
      cv::fisheye::projectPoints(points, theirs, none, none, k, distortion_of(p));
    } else {
      cv::projectPoints(points, none, none, k, distortion_of(p), theirs);
    }
    for (size_t i = 0; i < points.size(); ++i) {
      EXPECT_NEAR(ours[i].x(), theirs[i].x, 1e-8) << name;
      EXPECT_NEAR(ours[i].y(), theirs[i].y, 1e-8) << name;
    }
  }
}

}  // namespace
}  // namespace sightline
