// SPDX-License-Identifier: Apache-2.0
//
// Axes of heads whose truth is known, from exact projections with noise.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "calibrate/axes/head_problem.hpp"
#include "sightline/calibrate/axes_report.hpp"
#include "sightline/calibrate/solve_axes.hpp"
#include "support/matchers.hpp"
#include "synthetic_head.hpp"

namespace sightline {
namespace {

using test::IsOk;
using test::MatrixNear;
using test::SyntheticHeadOptions;
using AxesVector = Eigen::Matrix<double, kAxesParameters, 1>;

constexpr double kDegree = std::numbers::pi / 180;
constexpr uint64_t kSeeds = 12;

struct Solved {
  test::SyntheticHead head;
  AxesSolution solution;
  AxesVector error;
};

std::optional<Solved> solve(const SyntheticHeadOptions& o, const AxesOptions& options) {
  test::SyntheticHead head = test::make_head(o);
  auto solution = solve_axes(head.sights, head.calibration(), options);
  EXPECT_THAT(solution, IsOk()) << "seed " << o.seed;
  if (!solution) return std::nullopt;
  const AxesVector error = test::axes_error(*head.truth[0].axes, *solution, o.play_deg * kDegree);
  return Solved{std::move(head), *std::move(solution), error};
}

/// Squared error in units of the covariance, per parameter that was solved for.
double normalized_error(const Solved& s) {
  std::vector<int> rows;
  for (int i = 0; i < kAxesParameters; ++i) {
    if (s.solution.covariance(i, i) > 0) rows.push_back(i);
  }
  const Eigen::VectorXd e = s.error(rows);
  const Eigen::MatrixXd c = s.solution.covariance(rows, rows);
  return e.dot(c.ldlt().solve(e)) / static_cast<double>(rows.size());
}

/// A dozen heads: errors as large as the covariance says, none far beyond it.
void expect_honest(SyntheticHeadOptions o, const AxesOptions& options) {
  double sum = 0;
  size_t far = 0, all = 0;
  for (o.seed = 1; o.seed <= kSeeds; ++o.seed) {
    const auto solved = solve(o, options);
    ASSERT_TRUE(solved);
    sum += normalized_error(*solved);
    for (int i = 0; i < kAxesParameters; ++i) {
      const double sigma = std::sqrt(solved->solution.covariance(i, i));
      EXPECT_LE(std::abs(solved->error[i]), 4 * sigma) << "seed " << o.seed << " parameter " << i;
      far += std::abs(solved->error[i]) > 3 * sigma;
      ++all;
    }
  }
  // Twelve times some nineteen parameters: the mean of chi^2 per parameter is 1 +- 0.1; the
  // rounding that is taken for granted (a step's sigma) makes it a little cautious.
  testing::Test::RecordProperty("normalized", std::to_string(sum / kSeeds));
  EXPECT_GT(sum / kSeeds, 0.5);
  EXPECT_LT(sum / kSeeds, 1.35);
  EXPECT_LE(far, all / 50);
}

TEST(SolveAxes, ErrorsAreInsideTheCovariance) { expect_honest({}, {}); }

TEST(SolveAxes, ErrorsAreInsideTheCovarianceOfANoisyEncoder) {
  expect_honest({.step_deg = 0, .noise_deg = 0.05}, {});
}

TEST(SolveAxes, ErrorsAreInsideTheCovarianceWithTheLensRefined) {
  expect_honest({.settings = 24}, {.refine_lens = true, .scales = AxesScales::kFree});
}

TEST(SolveAxes, PlayIsFoundFromBothSides) {
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const auto solved = solve({.settings = 24, .play_deg = 0.3, .seed = seed}, {});
    ASSERT_TRUE(solved);
    EXPECT_NEAR(solved->solution.pan_play, 0.3 * kDegree, 0.03 * kDegree);
    EXPECT_NEAR(solved->solution.tilt_play, 0.3 * kDegree, 0.03 * kDegree);
    EXPECT_NEAR(solved->solution.camera.axes->backlash, 0.3 * kDegree, 0.03 * kDegree);
    EXPECT_LT(normalized_error(*solved), 2.5);
  }
}

TEST(SolveAxes, ADeviceThatCountsTheOtherWayOrInOtherUnits) {
  for (const double pan : {1.0, -1.0, 0.5}) {
    for (const double tilt : {1.0, -1.0, -1.4}) {
      const auto solved = solve({.pan_scale = pan, .tilt_scale = tilt, .seed = 5}, {});
      ASSERT_TRUE(solved);
      const CameraAxes& axes = *solved->solution.camera.axes;
      EXPECT_NEAR(axes.pan_scale, pan, 0.01 * std::abs(pan));
      EXPECT_NEAR(axes.tilt_scale, tilt, 0.015 * std::abs(tilt));
      EXPECT_NEAR(axes.latency_s, 0.04, 5e-4);
    }
  }
}

TEST(SolveAxes, LatencyFromNoneToTheMost) {
  for (const double latency : {0.0, 0.015, 0.12, 0.35}) {
    const auto solved = solve({.latency_s = latency, .seed = 3}, {});
    ASSERT_TRUE(solved);
    EXPECT_NEAR(solved->solution.camera.axes->latency_s, latency, 1e-3);
    EXPECT_LT(solved->solution.camera.axes->latency_sigma_s, 2e-3);
  }
}

TEST(SolveAxes, TheBoardAtTwoPlacesAndNoOtherCamera) {
  auto head = test::make_head({.recordings = 2, .fixed_cameras = 0, .seed = 4});
  const auto solved = solve_axes(head.sights, head.calibration(), {});
  ASSERT_THAT(solved, IsOk());
  // The world is the first board's, its print up: compared from there.
  const Rigid3 up(Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero());
  CameraAxes truth = *head.truth[0].axes;
  truth.world_from_base = up * head.world_from_body[0].inverse() * truth.world_from_base;
  for (const double pan : {-12.0, 0.0, 12.0}) {
    for (const double tilt : {-7.0, 7.0}) {
      EXPECT_THAT(
          solved->camera.axes->world_from_camera(solved->camera.axes->pan_scale * pan * kDegree,
                                                 solved->camera.axes->tilt_scale * tilt * kDegree),
          test::PoseNear(truth.world_from_camera(pan * kDegree, tilt * kDegree), 0.06 * kDegree,
                         0.0015));
    }
  }
  EXPECT_THAT(solved->world, testing::HasSubstr("board of recording 1, its print up"));
}

TEST(SolveAxes, TargetsWhosePlaceIsKnownTieItToTheWorld) {
  auto head = test::make_head({.fixed_cameras = 0, .seed = 6});
  head.sights.bodies[0].world_from_body = head.world_from_body[0];
  const auto solved = solve_axes(head.sights, head.calibration(), {});
  ASSERT_THAT(solved, IsOk());
  const AxesVector error = test::axes_error(*head.truth[0].axes, *solved, 0);
  for (int i = 0; i < kAxesParameters; ++i) {
    EXPECT_LE(std::abs(error[i]), 4 * std::sqrt(solved->covariance(i, i))) << i;
  }
}

TEST(SolveAxes, ARowOfTheZoomTableForEachSetting) {
  const auto solved = solve({.settings = 14, .zooms = {0, 600}, .seed = 2}, {.zoom = true});
  ASSERT_TRUE(solved);
  const auto& zoom = solved->solution.camera.axes->zoom;
  ASSERT_EQ(zoom.size(), 2u);
  for (const ZoomLens& lens : zoom) {
    const double focal = 900 * test::zoom_factor(lens.setting);
    EXPECT_NEAR(lens.fx, focal, 4 * lens.sigma * focal);
    EXPECT_LT(lens.sigma, 0.01);
    EXPECT_GT(lens.sigma, 1e-5);
  }
  EXPECT_NEAR(zoom[1].setting, 600, 1e-6);
  const auto scale =
      std::ranges::find(solved->solution.estimates, "pan_scale", &AxesEstimate::name);
  EXPECT_THAT(scale->held, testing::HasSubstr("may be 1, and is held there"));
  // The lens in use is the one that the calibration had.
  EXPECT_EQ(solved->solution.camera.model.parameters().fx, zoom[0].fx);
}

TEST(SolveAxes, AScaleThatIsNotOneStaysFreeBesideALens) {
  const auto solved = solve({.pan_scale = 0.9, .seed = 2}, {.refine_lens = true});
  ASSERT_TRUE(solved);
  EXPECT_NEAR(solved->solution.camera.axes->pan_scale, 0.9, 0.02);
  EXPECT_GT(solved->solution.covariance(kPanScale, kPanScale), 0);
}

TEST(SolveAxes, WhatIsNotSaidIsHeldByName) {
  const auto solved = solve({.moving_s = 0, .seed = 2}, {.scales = AxesScales::kHold});
  ASSERT_TRUE(solved);
  // Between two settings there are images in motion as well; few of them.
  EXPECT_EQ(std::abs(solved->solution.camera.axes->pan_scale), 1);
  const auto scale =
      std::ranges::find(solved->solution.estimates, "pan_scale", &AxesEstimate::name);
  EXPECT_THAT(scale->held, testing::HasSubstr("readings are degrees"));

  auto head = test::make_head({.moving_s = 0, .seed = 2});
  for (auto& recording : head.sights.recordings) {  // stills: what moves is not seen
    std::erase_if(recording.images, [&](const HeadImage& image) {
      const double t = std::fmod(to_seconds(image.capture - test::kHeadStart), 1.3);
      return t > 0.8;
    });
  }
  const auto still = solve_axes(head.sights, head.calibration(), {});
  ASSERT_THAT(still, IsOk());
  const auto latency = std::ranges::find(still->estimates, "latency", &AxesEstimate::name);
  EXPECT_THAT(latency->held, testing::HasSubstr("turn to and fro for ten seconds"));
  EXPECT_EQ(assess_axes(*still).grade, CalibrationGrade::kUsable);
}

TEST(SolveAxes, ASettingThatIsReadWrongIsLeftOut) {
  auto head = test::make_head({.seed = 8});
  for (AxisReading& r : head.sights.recordings[0].readings) {
    const double t = to_seconds(r.stamp - test::kHeadStart);
    if (t > 6.4 && t < 7.5) r.pan += 2 * kDegree;  // at one of the sixteen
  }
  const auto solved = solve_axes(head.sights, head.calibration(), {});
  ASSERT_THAT(solved, IsOk());
  EXPECT_EQ(solved->settings_left_out, 1u);
  const AxesVector error = test::axes_error(*head.truth[0].axes, *solved, 0);
  for (int i = 0; i < kPanPlay; ++i) {
    EXPECT_LE(std::abs(error[i]), 4 * std::sqrt(solved->covariance(i, i))) << i;
  }
}

TEST(SolveAxes, TheReportJudgesByWhatWasLeftOut) {
  const auto solved = solve({.seed = 9}, {});
  ASSERT_TRUE(solved);
  const AxesReport report = assess_axes(solved->solution);
  EXPECT_EQ(report.grade, CalibrationGrade::kGood) << report.remarks.at(0);
  ASSERT_TRUE(report.held_out_deg);
  // Rounding to 0.05 degrees in two axes, and what the fit is off by.
  EXPECT_GT(*report.held_out_deg, 0.01);
  EXPECT_LT(*report.held_out_deg, 0.04);
  EXPECT_EQ(report.at_rest, 16u);
  const std::string html = axes_report_html(solved->solution, report, "0");
  for (const char* title : {"Errors by setting", "Where the head was", "by latency",
                            "Mean error by place", "Settings at rest"}) {
    EXPECT_NE(html.find(title), std::string::npos) << title;
  }
  EXPECT_EQ(html.find("nan"), std::string::npos);
  EXPECT_EQ(html.find("<script"), std::string::npos);
}

// d(pixel) by everything that is solved for, against differences.
TEST(HeadProblem, DerivativesAgreeWithDifferences) {
  using namespace calibrate;
  test::Random random(3);
  const Rigid3 base = Rigid3::exp(0.3 * random.normal<6>());
  const Rigid3 camera = Rigid3::exp(0.3 * random.normal<6>());
  const std::array<double, 2> link{0.03, 0.02};
  const Eigen::Vector2d angles(0.4, -0.3);
  const HeadChain at = chain_of(base, link, camera, angles);
  constexpr double kStep = 1e-6;
  const auto slope = [&](const HeadChain& plus, const HeadChain& minus) -> Vector6 {
    return (difference(at.world_from_camera, plus.world_from_camera) -
            difference(at.world_from_camera, minus.world_from_camera)) /
           (2 * kStep);
  };
  for (int i = 0; i < 6; ++i) {
    const Vector6 d = kStep * Vector6::Unit(i);
    EXPECT_THAT(slope(chain_of(base * Rigid3::exp(d), link, camera, angles),
                      chain_of(base * Rigid3::exp(-d), link, camera, angles)),
                MatrixNear(at.by_base.col(i), 1e-7));
    EXPECT_THAT(slope(chain_of(base, link, camera * Rigid3::exp(d), angles),
                      chain_of(base, link, camera * Rigid3::exp(-d), angles)),
                MatrixNear(Vector6::Unit(i), 1e-7));
  }
  for (size_t i = 0; i < 2; ++i) {
    std::array<double, 2> plus = link, minus = link;
    plus[i] += kStep;
    minus[i] -= kStep;
    const auto column = static_cast<int>(i);
    EXPECT_THAT(slope(chain_of(base, plus, camera, angles), chain_of(base, minus, camera, angles)),
                MatrixNear(at.by_link.col(column), 1e-7));
    const Eigen::Vector2d d = kStep * Eigen::Vector2d::Unit(column);
    EXPECT_THAT(
        slope(chain_of(base, link, camera, angles + d), chain_of(base, link, camera, angles - d)),
        MatrixNear(at.by_angles.col(column), 1e-7));
  }
}

// It is the chain that everything else of this project goes by.
TEST(HeadProblem, TheChainIsThatOfCameraAxes) {
  test::Random random(4);
  for (int i = 0; i < 20; ++i) {
    CameraAxes axes;
    axes.world_from_base = Rigid3::exp(random.normal<6>());
    axes.pan_from_tilt = Rigid3::exp(0.2 * random.normal<6>());
    axes.tilt_from_camera = Rigid3::exp(random.normal<6>());
    const CameraAxes same = test::in_its_gauge(axes);
    const double pan = random.normal(), tilt = random.normal();
    EXPECT_THAT(same.world_from_camera(pan, tilt),
                test::PoseNear(axes.world_from_camera(pan, tilt), 1e-9, 1e-9));
    const double twist = std::asin(same.pan_from_tilt.rotation_matrix()(0, 2));
    EXPECT_THAT(
        calibrate::chain_of(same.world_from_base, {twist, same.pan_from_tilt.translation.y()},
                            same.tilt_from_camera, {pan, tilt})
            .world_from_camera,
        test::PoseNear(axes.world_from_camera(pan, tilt), 1e-9, 1e-9));
  }
}

}  // namespace
}  // namespace sightline
