// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/terms/line_term.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <random>

#include "print_scene.hpp"

namespace sightline {
namespace {

constexpr double kHuber = 2.0;

struct Setting {
  std::shared_ptr<const CalibratedCamera> camera;
  Rigid3 world_from_object;
  std::vector<LineMatch> lines;
};

// Lines through projected points in all directions; every third has rivals, every fifth is far off.
Setting make_setting(LensModel lens, double noise_px, bool outliers) {
  CalibratedCamera camera = test::test_camera(lens);
  Vector6 place;
  place << 0.3, -0.2, 0.5, 0.4, -0.1, 0.2;
  camera.world_from_camera = Rigid3::exp(place);
  Setting out;
  out.world_from_object = camera.world_from_camera *
                          Rigid3(Eigen::Quaterniond(0.3, 0.8, -0.2, 0.1), {0.05, -0.03, 0.9});
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place_of(-0.08, 0.08);
  std::normal_distribution<double> noise(0, 1);
  for (int i = 0; i < 60; ++i) {
    LineMatch line;
    line.point_in_object = {place_of(random), place_of(random), place_of(random)};
    const auto pixel = camera.model.project(camera.world_from_camera.inverse() *
                                            (out.world_from_object * line.point_in_object));
    const double angle = 2 * std::numbers::pi * i / 60;
    line.normal = {std::cos(angle), std::sin(angle)};
    line.center = *pixel + Eigen::Vector2d(0.7, -0.4);
    const double truth = line.normal.dot(*pixel - line.center);
    line.sigma_px = 0.4 + 0.1 * (i % 2);
    double offset = truth + noise_px * line.sigma_px * noise(random);
    if (outliers && i % 5 == 0) offset += 3.0;
    line.offset[0] = static_cast<float>(offset);
    if (i % 3 == 0) {
      line.offset[1] = static_cast<float>(offset + 4.0);
      line.offsets = 2;
    }
    out.lines.push_back(line);
  }
  out.camera = std::make_shared<const CalibratedCamera>(camera);
  return out;
}

const LineError kErrors[] = {{}, {0.3, 0}, {0.3, 0.2}};

TEST(LineTerm, GradientIsTheDerivativeOfTheCost) {
  for (const LensModel lens : {LensModel::kBrownConrady, LensModel::kFisheye}) {
    const Setting s = make_setting(lens, 1.0, true);
    for (const LineError& error : kErrors) {
      for (const double share : {1.0, 0.2}) {
        const LineTerm term("region", s.camera, s.lines, kHuber, error, share);
        const LinearizedTerm at = term.linearize(s.world_from_object);
        for (int i = 0; i < 6; ++i) {
          Vector6 d = Vector6::Zero();
          d[i] = 1e-7;
          const double up = term.linearize(s.world_from_object * Rigid3::exp(d)).cost;
          const double down = term.linearize(s.world_from_object * Rigid3::exp(-d)).cost;
          EXPECT_NEAR(at.gradient[i], (up - down) / 2e-7, 2e-3 * (1 + std::abs(at.gradient[i])));
        }
      }
    }
  }
}

TEST(LineTerm, InformationIsTheCurvatureWhereNothingIsAnOutlier) {
  const Setting s = make_setting(LensModel::kBrownConrady, 0.01, false);
  for (const LineError& error : kErrors) {
    const LineTerm term("edge", s.camera, s.lines, kHuber, error, 0.5);
    const LinearizedTerm at = term.linearize(s.world_from_object);
    for (int i = 0; i < 6; ++i) {
      Vector6 d = Vector6::Zero();
      d[i] = 1e-5;
      const Vector6 up = term.linearize(s.world_from_object * Rigid3::exp(d)).gradient;
      const Vector6 down = term.linearize(s.world_from_object * Rigid3::exp(-d)).gradient;
      const Vector6 column = (up - down) / 2e-5;
      EXPECT_LT((at.information.col(i) - column).norm(), 0.01 * column.norm());
    }
  }
}

TEST(LineTerm, TheMinimumIsAsFarOffAsTheInformationSays) {
  // 400 draws of noise, errors that all share included: the mean of g^T H^-1 g is six.
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0, 1);
  const LineError error{0.3, 0.2};
  const Setting s = make_setting(LensModel::kBrownConrady, 0, false);
  double sum = 0;
  constexpr int kDraws = 400;
  for (int draw = 0; draw < kDraws; ++draw) {
    std::vector<LineMatch> lines = s.lines;
    const Eigen::Vector2d shift(0.3 * normal(random), 0.3 * normal(random));
    const double dilation = 0.2 * normal(random);
    for (LineMatch& line : lines) {
      line.offsets = 1;
      line.offset[0] -=
          static_cast<float>(line.normal.dot(shift) + dilation - line.sigma_px * normal(random));
    }
    const LineTerm term("region", s.camera, lines, 10.0, error);
    const LinearizedTerm at = term.linearize(s.world_from_object);
    sum += at.gradient.dot(at.information.ldlt().solve(at.gradient));
  }
  EXPECT_NEAR(sum / kDraws, 6.0, 0.6);
}

TEST(LineTerm, DependentLinesSayLessButTheSame) {
  const Setting s = make_setting(LensModel::kBrownConrady, 1.0, true);
  const LinearizedTerm all =
      LineTerm("region", s.camera, s.lines, kHuber, {}, 1.0).linearize(s.world_from_object);
  const LinearizedTerm some =
      LineTerm("region", s.camera, s.lines, kHuber, {}, 0.25).linearize(s.world_from_object);
  EXPECT_LT((0.25 * all.information - some.information).norm(), 1e-9 * all.information.norm());
  EXPECT_NEAR(0.25 * all.cost, some.cost, 1e-9 * all.cost);
  EXPECT_EQ(all.residuals, 60);
  EXPECT_EQ(some.residuals, 15);
  EXPECT_EQ(all.quality, some.quality);
}

TEST(LineTerm, BehindTheCameraItPullsNowhereAndSaysSo) {
  const Setting s = make_setting(LensModel::kBrownConrady, 1.0, false);
  const LineTerm term("region", s.camera, s.lines, kHuber, {0.3, 0.2});
  const Rigid3 behind = s.camera->world_from_camera * Rigid3({1, 0, 0, 0}, {0, 0, -1});
  const LinearizedTerm at = term.linearize(behind);
  EXPECT_EQ(at.quality, 0);
  EXPECT_TRUE(at.information.isZero(0));
  EXPECT_GT(at.cost, 100);
}

}  // namespace
}  // namespace sightline
