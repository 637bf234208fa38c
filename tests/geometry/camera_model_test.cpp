// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/camera_model.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "lenses.hpp"
#include "support/matchers.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;
using test::lenses;
using test::MatrixNear;
using Parameters = CameraModel::Parameters;

CameraModel make(const Parameters& p) { return CameraModel::create(p, "test").value(); }

Parameters with_distortion(LensModel lens, std::array<double, 8> k) {
  return Parameters{lens, 640, 480, 500, 500, 320, 240, k};
}

TEST(CameraModel, ProjectInvertsUnprojectOverTheImage) {
  for (const auto& [name, p] : lenses()) {
    const CameraModel camera = make(p);
    for (int y = -1; y <= p.height; y += 23) {
      for (int x = -1; x <= p.width; x += 23) {
        const Eigen::Vector2d pixel(x + 0.37, y - 0.21);
        const auto ray = camera.unproject(pixel);
        ASSERT_TRUE(ray) << name << " at " << pixel.transpose();
        EXPECT_NEAR(ray->norm(), 1, 1e-12);
        const auto back = camera.project(*ray * 2.5);
        ASSERT_TRUE(back) << name << " at " << pixel.transpose();
        EXPECT_THAT(*back, MatrixNear(pixel, 1e-6)) << name;
      }
    }
  }
}

TEST(CameraModel, UnprojectInvertsProjectInsideTheFold) {
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const auto& [name, p] : lenses()) {
    const CameraModel camera = make(p);
    for (int i = 0; i < 500; ++i) {
      const Eigen::Vector3d point(0.9 * unit(rng), 0.7 * unit(rng), 1 + 0.2 * unit(rng));
      const auto pixel = camera.project(point);
      if (!pixel || !camera.contains(*pixel)) continue;
      const auto ray = camera.unproject(*pixel);
      ASSERT_TRUE(ray) << name;
      EXPECT_THAT(*ray, MatrixNear(Eigen::Vector3d(point.normalized()), 1e-8)) << name;
    }
  }
}

TEST(CameraModel, JacobianAgreesWithNumericDerivative) {
  constexpr double kStep = 1e-6;
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const auto& [name, p] : lenses()) {
    const CameraModel camera = make(p);
    for (int i = 0; i < 200; ++i) {
      Eigen::Vector3d point(0.6 * unit(rng), 0.5 * unit(rng), 1 + 0.5 * unit(rng));
      if (i == 0) point = {0, 0, 1.3};         // on the axis
      if (i == 1) point = {1e-9, -2e-9, 0.8};  // all but on it
      Eigen::Matrix<double, 2, 3> jacobian;
      if (!camera.project(point, &jacobian)) continue;
      Eigen::Matrix<double, 2, 3> numeric;
      for (int c = 0; c < 3; ++c) {
        const Eigen::Vector3d h = kStep * Eigen::Vector3d::Unit(c);
        const auto a = camera.project(point - h);
        const auto b = camera.project(point + h);
        ASSERT_TRUE(a && b) << name;
        numeric.col(c) = (*b - *a) / (2 * kStep);
      }
      EXPECT_THAT(jacobian, MatrixNear(numeric, 1e-6 * numeric.cwiseAbs().maxCoeff() + 1e-5))
          << name;
    }
  }
}

TEST(CameraModel, FisheyeSeesBesideAndBehindTheImagePlane) {
  const CameraModel camera = make(with_distortion(LensModel::kFisheye, {}));
  EXPECT_DOUBLE_EQ(camera.max_valid_radius(), std::numbers::pi);
  const auto side = camera.project({1, 0, 0});
  ASSERT_TRUE(side);
  EXPECT_NEAR(side->x(), 320 + 500 * std::numbers::pi / 2, 1e-9);
  const auto behind = camera.project({1, 0, -1});
  ASSERT_TRUE(behind);
  EXPECT_NEAR(behind->x(), 320 + 500 * 0.75 * std::numbers::pi, 1e-9);
  EXPECT_FALSE(camera.project({0, 0, -1}));
  EXPECT_FALSE(camera.project({0, 0, 0}));
}

TEST(CameraModel, RefusesPointsBehindAPinhole) {
  const CameraModel camera = make(with_distortion(LensModel::kBrownConrady, {}));
  EXPECT_FALSE(camera.project({0.1, 0, 0}));
  EXPECT_FALSE(camera.project({0.1, 0, -1}));
  EXPECT_FALSE(camera.project({std::nan(""), 0, 1}));
  EXPECT_FALSE(camera.project({1, 1, 1e-320}));
}

/// The fold is where the slope of the radial profile first reaches zero; a dense scan finds it.
TEST(CameraModel, FoldOverRadiusAgreesWithAScan) {
  const std::array<std::array<double, 8>, 6> coefficients{{{-0.3, 0, 0, 0, 0},
                                                           {-0.33, 0.046, -0.004, 0.004, 0.066},
                                                           {0.1, -0.2, 0, 0, 0.01},
                                                           {0, 0, 0, 0, -0.02},
                                                           {-0.4, 0.3, 0, 0, -0.1},
                                                           {0.2, -0.3, 0, 0, 0.05}}};
  for (const auto& k : coefficients) {
    const CameraModel camera = make(with_distortion(LensModel::kBrownConrady, k));
    double scanned = std::numeric_limits<double>::infinity();
    for (double r = 1e-4; r < 20; r += 1e-4) {
      const double u = r * r;
      if (1 + u * (3 * k[0] + u * (5 * k[1] + u * 7 * k[4])) < 0) {
        scanned = r;
        break;
      }
    }
    if (std::isinf(scanned)) {
      EXPECT_TRUE(std::isinf(camera.max_valid_radius()));
    } else {
      EXPECT_NEAR(camera.max_valid_radius(), scanned, 2e-4);
    }
  }
}

TEST(CameraModel, RefusesPointsBeyondTheFold) {
  const CameraModel camera = make(with_distortion(LensModel::kBrownConrady, {-0.3}));
  const double fold = 1 / std::sqrt(0.9);  // 1 - 0.9 r^2 = 0
  EXPECT_NEAR(camera.max_valid_radius(), fold, 1e-12);
  EXPECT_TRUE(camera.project({fold - 1e-6, 0, 1}));
  EXPECT_FALSE(camera.project({fold + 1e-6, 0, 1}));
  // The outermost pixel that exists, and one beyond it.
  const double reach = 500 * fold * (1 - 0.3 * fold * fold);
  EXPECT_TRUE(camera.unproject({320 + reach - 0.01, 240}));
  EXPECT_FALSE(camera.unproject({320 + reach + 0.01, 240}));
  EXPECT_FALSE(camera.unproject({std::nan(""), 240}));
  EXPECT_FALSE(camera.unproject({1e300, 240}));
}

TEST(CameraModel, RationalLensStopsAtItsPole) {
  // Denominator 1 - 0.5 r^2 has its zero at r = sqrt(2); the numerator alone never folds.
  const CameraModel camera =
      make(with_distortion(LensModel::kRational, {0, 0, 0, 0, 0, -0.5, 0, 0}));
  EXPECT_NEAR(camera.max_valid_radius(), std::sqrt(2.0), 1e-9);
  EXPECT_FALSE(camera.project({1.5, 0, 1}));
}

TEST(CameraModel, RationalLensFoldsWhereItsQuotientTurns) {
  // r / (1 + r^2) turns at r = 1.
  const CameraModel camera = make(with_distortion(LensModel::kRational, {0, 0, 0, 0, 0, 1, 0, 0}));
  EXPECT_NEAR(camera.max_valid_radius(), 1, 1e-9);
}

TEST(CameraModel, FisheyeFolds) {
  const CameraModel camera = make(with_distortion(LensModel::kFisheye, {-0.1}));
  EXPECT_NEAR(camera.max_valid_radius(), std::sqrt(1 / 0.3), 1e-9);
  const double angle = camera.max_valid_radius() + 1e-6;
  EXPECT_FALSE(camera.project({std::sin(angle), 0, std::cos(angle)}));
}

TEST(CameraModel, ContainsWholePixels) {
  const CameraModel camera = make(with_distortion(LensModel::kBrownConrady, {}));
  EXPECT_TRUE(camera.contains({-0.5, -0.5}));
  EXPECT_TRUE(camera.contains({639.49, 479.49}));
  EXPECT_FALSE(camera.contains({639.5, 100}));
  EXPECT_FALSE(camera.contains({10, -0.51}));
  EXPECT_FALSE(camera.contains({std::nan(""), 0}));
}

TEST(CameraModel, TakesLensesThatAreRareButReal) {
  Parameters p = with_distortion(LensModel::kBrownConrady, {});
  p.fx = p.fy = 3e6;  // 0.01 degrees
  p.distortion[4] = -1.6e6;
  EXPECT_THAT(CameraModel::create(p, "tele"), IsOk());
  p.fx = p.fy = 10'000;
  p.cx = -30'000;  // a window of a large sensor
  EXPECT_THAT(CameraModel::create(p, "window"), IsOk());
  p = with_distortion(LensModel::kFisheye, {});
  p.fx = p.fy = 20;
  EXPECT_THAT(CameraModel::create(p, "wide"), IsOk());
}

TEST(CameraModel, RefusesImpossibleParameters) {
  const Parameters good = with_distortion(LensModel::kBrownConrady, {});
  Parameters p = good;
  p.width = 0;
  EXPECT_THAT(CameraModel::create(p, "left"), FailsWith("left: image size 0x480"));
  p = good;
  p.height = 40000;
  EXPECT_THAT(CameraModel::create(p, "left"), FailsWith("outside 1..32768"));
  p = good;
  p.fy = -1;
  EXPECT_THAT(CameraModel::create(p, "left"), FailsWith("focal"));
  p = good;
  p.cx = std::nan("");
  EXPECT_THAT(CameraModel::create(p, "left"), FailsWith("principal point"));
  p = good;
  p.distortion[1] = std::numeric_limits<double>::infinity();
  EXPECT_THAT(CameraModel::create(p, "left"), FailsWith("coefficient 2"));
  p = good;
  for (const double focal : {1e300, 1e-300, 6.3, 6.5e6, 0.0}) {
    p.fx = focal;
    EXPECT_THAT(CameraModel::create(p, "left"), FailsWith("left: focal lengths fx")) << focal;
  }
  p = good;
  for (const double center : {1e300, -1e300, 65'000.0, -64'000.0}) {
    p.cy = center;
    EXPECT_THAT(CameraModel::create(p, "left"), FailsWith("left: principal point")) << center;
  }
  p = good;
  for (const double coefficient : {1e300, -1e13}) {
    p.distortion[4] = coefficient;
    EXPECT_THAT(CameraModel::create(p, "left"), FailsWith("left: distortion coefficient 5 is"));
  }
  p = good;
  p.distortion[5] = 0.1;
  EXPECT_THAT(CameraModel::create(p, "left"), FailsWith("has only 5"));
}

}  // namespace
}  // namespace sightline
