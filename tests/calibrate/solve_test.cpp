// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/solve.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "../support/matchers.hpp"
#include "calibrate/solve/bundle.hpp"
#include "calibrate/solve/corner_at_set.hpp"
#include "calibrate/solve/lens_projection.hpp"
#include "sightline/calibrate/assess.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "synthetic_views.hpp"

namespace sightline {
namespace {

using test::IsOk;
using test::make_rig;
using test::SyntheticRig;

/// Errors over claimed sigmas, of all that was solved for.
std::vector<double> normalized_errors(const SyntheticRig& rig, const RigSolution& solution) {
  std::vector<double> z;
  for (size_t c = 0; c < rig.truth.size(); ++c) {
    const SolvedCamera& solved = solution.cameras[c];
    const calibrate::LensVector truth = calibrate::lens_vector(rig.truth[c].model);
    for (size_t i = 0; i < solved.estimates.size(); ++i) {
      if (solved.lens_columns[i] >= calibrate::kTimeOffset) continue;
      const double error =
          solved.estimates[i].value - truth[static_cast<size_t>(solved.lens_columns[i])];
      z.push_back(error / solved.estimates[i].sigma);
    }
    if (!solved.has_place) continue;
    const Vector6 d = difference(solved.camera.world_from_camera, rig.truth[c].world_from_camera);
    const Vector6 sigma = solved.place_covariance().diagonal().cwiseSqrt();
    for (int i = 0; i < 6; ++i) z.push_back(d[i] / sigma[i]);
  }
  return z;
}

void expect_honest(const SyntheticRig& rig, const RigSolution& solution) {
  const std::vector<double> z = normalized_errors(rig, solution);
  ASSERT_GT(z.size(), 8u);
  double squares = 0;
  size_t beyond = 0;
  for (const double each : z) {
    squares += each * each;
    beyond += std::abs(each) > 3;
    EXPECT_LT(std::abs(each), 4.5);
  }
  const double mean = squares / static_cast<double>(z.size());
  EXPECT_GT(mean, 0.3) << "sigmas are claimed too large";
  EXPECT_LT(mean, 2.5) << "sigmas are claimed too small";
  EXPECT_LE(static_cast<double>(beyond), 1 + 0.01 * static_cast<double>(z.size()));
}

TEST(LensProjection, IsTheCameraModelsWithExactDerivatives) {
  for (const LensModel lens :
       {LensModel::kBrownConrady, LensModel::kRational, LensModel::kFisheye}) {
    const SyntheticRig rig = make_rig({.cameras = 1, .sets = 1, .lens = lens});
    const CameraModel& model = rig.truth[0].model;
    const calibrate::LensVector values = calibrate::lens_vector(model);
    for (const Eigen::Vector3d& p :
         {Eigen::Vector3d(0.2, -0.1, 1.1), {-0.4, 0.25, 0.9}, {1e-12, 0, 2}, {0.3, 0.3, 0.7}}) {
      Eigen::Vector2d pixel;
      Eigen::Matrix<double, 2, 3> by_point;
      Eigen::Matrix<double, 2, 12> by_lens;
      ASSERT_TRUE(calibrate::project_lens(lens, values.data(), p, pixel, &by_point, &by_lens));
      const auto expected = model.project(p);
      ASSERT_TRUE(expected);
      EXPECT_THAT(pixel, test::MatrixNear(*expected, 1e-9));
      const auto at = [&](const calibrate::LensVector& v, const Eigen::Vector3d& q) {
        Eigen::Vector2d out;
        EXPECT_TRUE(calibrate::project_lens(lens, v.data(), q, out, nullptr, nullptr));
        return out;
      };
      for (int i = 0; i < 3; ++i) {
        const Eigen::Vector3d d = 1e-6 * Eigen::Vector3d::Unit(i);
        EXPECT_THAT(by_point.col(i),
                    test::MatrixNear((at(values, p + d) - at(values, p - d)) / 2e-6, 1e-3));
      }
      for (size_t i = 0; i < static_cast<size_t>(4 + calibrate::coefficient_count(lens)); ++i) {
        calibrate::LensVector above = values, below = values;
        above[i] += 1e-6;
        below[i] -= 1e-6;
        EXPECT_THAT(by_lens.col(static_cast<Eigen::Index>(i)),
                    test::MatrixNear((at(above, p) - at(below, p)) / 2e-6, 1e-4));
      }
    }
  }
}

TEST(SolveRig, OneCameraFromNothing) {
  const SyntheticRig rig = make_rig({.cameras = 1, .sets = 25});
  const auto solution = solve_rig(rig.views, {});
  ASSERT_THAT(solution, IsOk());
  EXPECT_NEAR(solution->sigma_px, 0.2, 0.02);
  expect_honest(rig, *solution);
}

TEST(SolveRig, StereoPairKeepsItsClaims) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const SyntheticRig rig = make_rig({.cameras = 2, .sets = 30, .seed = seed});
    const auto solution = solve_rig(rig.views, {});
    ASSERT_THAT(solution, IsOk());
    expect_honest(rig, *solution);
  }
}

TEST(SolveRig, RingsKeepTheirClaims) {
  for (const size_t cameras : {size_t{8}, size_t{16}}) {
    const SyntheticRig rig = make_rig({.cameras = cameras, .sets = 4 * cameras, .seed = 7});
    SolveOptions options;
    options.reject_sigmas = 0;
    const auto solution = solve_rig(rig.views, options);
    ASSERT_THAT(solution, IsOk());
    EXPECT_NEAR(solution->sigma_px, 0.2, 0.01);
    expect_honest(rig, *solution);
  }
}

TEST(SolveRig, OtherLenses) {
  for (const LensModel lens : {LensModel::kRational, LensModel::kFisheye}) {
    const bool fisheye = lens == LensModel::kFisheye;
    const SyntheticRig rig = make_rig({.cameras = 2,
                                       .sets = 40,
                                       .lens = lens,
                                       .focal = fisheye ? 420.0 : 800.0,
                                       .nearest = fisheye ? 0.3 : 0.6});
    SolveOptions options;
    options.cameras.assign(2, {lens, std::nullopt});
    const auto solution = solve_rig(rig.views, options);
    ASSERT_THAT(solution, IsOk());
    EXPECT_NEAR(solution->sigma_px, 0.2, 0.02);
    // Coefficients of the rational lens trade among themselves; its images must agree.
    for (size_t c = 0; c < 2; ++c) {
      const CameraModel &truth = rig.truth[c].model, &found = solution->cameras[c].camera.model;
      EXPECT_NEAR(found.parameters().fx, truth.parameters().fx,
                  4 * solution->cameras[c].estimates[0].sigma);
    }
    if (fisheye) expect_honest(rig, *solution);
  }
}

TEST(SolveRig, KnownLensesAreHeld) {
  const SyntheticRig rig = make_rig({.cameras = 2, .sets = 10});
  SolveOptions options;
  for (const CalibratedCamera& c : rig.truth) {
    options.cameras.push_back({c.model.parameters().lens, c.model});
  }
  const auto solution = solve_rig(rig.views, options);
  ASSERT_THAT(solution, IsOk());
  for (size_t c = 0; c < 2; ++c) {
    EXPECT_EQ(solution->cameras[c].camera.model, rig.truth[c].model);
    EXPECT_TRUE(solution->cameras[c].estimates.empty());
  }
  EXPECT_THAT(solution->cameras[1].camera.world_from_camera,
              test::PoseNear(rig.truth[1].world_from_camera, 8e-4, 1.5e-3));
}

TEST(SolveRig, IsWrittenWithItsSigmas) {
  const SyntheticRig rig = make_rig({.cameras = 2, .sets = 25});
  const auto solution = solve_rig(rig.views, {});
  ASSERT_THAT(solution, IsOk());
  const std::string text = format_solution(*solution, "2024-05-31", "epoch 0123");
  const auto back = parse_calibration(text, "calibration.toml");
  ASSERT_THAT(back, IsOk());
  ASSERT_EQ(back->size(), 2u);
  EXPECT_EQ((*back)[1].model, solution->cameras[1].camera.model);
  EXPECT_NE(text.find("# epoch 0123\n"), std::string::npos);
  EXPECT_NE(text.find("date = 2024-05-31\n[camera.sigmas]\nfx = 0."), std::string::npos);
}

TEST(SolveRig, FindsTheBendOfTheTarget) {
  const Eigen::Vector2d bend(0.003, -0.002);
  const SyntheticRig rig = make_rig({.cameras = 2, .sets = 40, .bend = bend});
  SolveOptions options;
  const auto flat = solve_rig(rig.views, options);
  ASSERT_THAT(flat, IsOk());
  options.bend = true;
  const auto bent = solve_rig(rig.views, options);
  ASSERT_THAT(bent, IsOk());
  EXPECT_GT(flat->rms_px, 1.3 * bent->rms_px);
  for (int i = 0; i < 2; ++i) EXPECT_NEAR(bent->bend[i], bend[i], 4 * bent->bend_sigma[i]);
  expect_honest(rig, *bent);
}

TEST(SolveRig, FindsLateStamps) {
  const SyntheticRig rig = make_rig({.cameras = 2, .sets = 40, .offset_s = 0.03, .speed = 0.4});
  SolveOptions options;
  options.reject_sigmas = 0;
  options.time_offsets = true;
  const auto timed = solve_rig(rig.views, options);
  ASSERT_THAT(timed, IsOk());
  EXPECT_LT(timed->rms_px, 0.3);  // of noise of 0.2 px in each coordinate
  EXPECT_NEAR(timed->cameras[1].time_offset_s, 0.03, 0.002);
  EXPECT_EQ(timed->cameras[0].time_offset_s, 0);
}

// Places of the corners, and how fast they move there, are those of rows that were exposed one
// after the other; the target moves and turns.
TEST(SolveRig, FindsTheReadoutOfRollingShutters) {
  const SyntheticRig rig = make_rig(
      {.cameras = 3, .sets = 60, .offset_s = 0.012, .speed = 0.4, .turn = 0.8, .readout_s = 0.028});
  SolveOptions options;
  options.reject_sigmas = 0;
  options.time_offsets = true;
  const auto global = solve_rig(rig.views, options);
  ASSERT_THAT(global, IsOk());
  options.readouts = true;
  const auto rolling = solve_rig(rig.views, options);
  ASSERT_THAT(rolling, IsOk());
  EXPECT_GT(global->rms_px, 2 * rolling->rms_px);
  EXPECT_LT(rolling->rms_px, 0.3);  // of noise of 0.2 px in each coordinate
  expect_honest(rig, *rolling);
  for (size_t c = 0; c < 3; ++c) {
    const ParameterEstimate& readout = rolling->cameras[c].estimates.back();
    EXPECT_EQ(readout.name, "readout_s");
    EXPECT_EQ(readout.value, rolling->cameras[c].camera.readout_s);
    EXPECT_LT(readout.sigma, 0.001);
    EXPECT_NEAR(readout.value, rig.truth[c].readout_s, 4 * readout.sigma) << c;
  }
  EXPECT_NEAR(rolling->cameras[1].time_offset_s, 0.012, 0.001);
  EXPECT_THAT(format_solution(*rolling, "2026-11-30", ""), testing::HasSubstr("readout_s = 0.02"));
}

// What a camera cannot have is not written: the file would be refused.
TEST(SolveRig, AReadoutThatNoSensorHasIsRefusedByName) {
  SolveOptions options;
  options.time_offsets = options.readouts = true;
  const SyntheticRig rig =
      make_rig({.cameras = 2, .sets = 40, .speed = 0.2, .turn = 0.5, .readout_s = 0.25});
  EXPECT_THAT(solve_rig(rig.views, options), test::FailsWith("which no sensor has"));
}

TEST(SolveRig, HoldsAKnownReadout) {
  const SyntheticRig rig =
      make_rig({.cameras = 2, .sets = 40, .speed = 0.4, .turn = 0.8, .readout_s = 0.028});
  SolveOptions options;
  options.cameras = {{.known = {}, .readout_s = -0.014}, {.known = {}, .readout_s = 0.028}};
  const auto known = solve_rig(rig.views, options);
  ASSERT_THAT(known, IsOk());
  EXPECT_LT(known->rms_px, 0.3);
  EXPECT_EQ(known->cameras[1].camera.readout_s, 0.028);
  expect_honest(rig, *known);
}

TEST(SolveRig, NothingTellsTheReadoutOfATargetThatStandsStill) {
  SolveOptions options;
  options.readouts = true;
  const SyntheticRig still = make_rig({.cameras = 2, .sets = 30, .readout_s = 0.028});
  EXPECT_THAT(solve_rig(still.views, options), test::FailsWith("read-outs: for these in motion"));
}

TEST(CornerAtSet, IsWhereItWasWithTheNumericDerivatives) {
  const TargetView view{0, 0, 0.004, {}, ""};
  const TargetCorner corner{0, {410, 630}, {-300, 500}, {900, -4000}};
  calibrate::LensVector values{};
  values[calibrate::kTimeOffset] = 0.007;
  const Eigen::Vector2d straight = corner.pixel - 0.011 * corner.px_per_s;
  const auto still = calibrate::corner_at_set(view, corner, values.data(), 0).pixel;
  EXPECT_LT((still - straight - 0.5 * 0.011 * 0.011 * corner.px_per_s2).norm(), 1e-9);
  values[calibrate::kReadout] = 0.03;
  const auto at = calibrate::corner_at_set(view, corner, values.data(), 720);
  for (const int parameter : {calibrate::kTimeOffset, calibrate::kReadout}) {
    const auto p = static_cast<size_t>(parameter);
    const double step = 1e-6;
    calibrate::LensVector more = values, less = values;
    more[p] += step;
    less[p] -= step;
    const Eigen::Vector2d slope = (calibrate::corner_at_set(view, corner, more.data(), 720).pixel -
                                   calibrate::corner_at_set(view, corner, less.data(), 720).pixel) /
                                  (2 * step);
    const auto& exact = parameter == calibrate::kReadout ? at.by_readout : at.by_offset;
    EXPECT_LT((exact - slope).norm(), 1e-5 * slope.norm());
  }
}

TEST(SolveRig, LeavesOutWrongCorners) {
  SyntheticRig rig = make_rig({.cameras = 2, .sets = 25});
  size_t wrong = 0;
  for (size_t v = 0; v < rig.views.views.size(); v += 3, ++wrong) {
    rig.views.views[v].corners[7].pixel += Eigen::Vector2d(9, -6);
  }
  const auto solution = solve_rig(rig.views, {});
  ASSERT_THAT(solution, IsOk());
  EXPECT_GE(solution->rejected, wrong);
  EXPECT_LE(solution->rejected, wrong + 5);
  expect_honest(rig, *solution);
}

TEST(AssessRig, HeldOutErrorAndHalvesAreOfTheNoise) {
  const SyntheticRig rig = make_rig({.cameras = 3, .sets = 45});
  const auto solution = solve_rig(rig.views, {});
  ASSERT_THAT(solution, IsOk());
  const auto report = assess_rig(rig.views, {}, *solution);
  ASSERT_THAT(report, IsOk());
  ASSERT_TRUE(report->held_out_px);
  // Noise of 0.2 px in each coordinate, and that of the prediction on top.
  EXPECT_GT(*report->held_out_px, 0.28);
  EXPECT_LT(*report->held_out_px, 0.45);
  ASSERT_TRUE(report->rigidity);
  EXPECT_LT(report->rigidity->rms_mm, 2);
  EXPECT_NEAR(report->rigidity->scale, 1, 1e-3);
  for (const CameraReport& camera : report->cameras) {
    ASSERT_TRUE(camera.split_half);
    EXPECT_LT(camera.split_half->median_px, 0.3);
    ASSERT_TRUE(camera.sigma);
    EXPECT_GT(camera.sigma->worst, camera.sigma->center);
    EXPECT_GT(camera.sigma->edge, camera.sigma->center);
    EXPECT_GE(camera.sigma->worst, camera.sigma->edge);
    ASSERT_TRUE(camera.sigma_near && camera.sigma_far);
    EXPECT_LT(camera.sigma_near->distance, camera.sigma->distance);
    EXPECT_GT(camera.sigma_far->distance, camera.sigma->distance);
    // The map is of the whole image; where the corners were, it says what they say.
    EXPECT_EQ(camera.split_half->px.size(), 16u * 12u);
    EXPECT_GT(camera.split_half->worst_mm, camera.split_half->median_mm);
    const double middle = camera.split_half->px[6 * 16 + 8];
    EXPECT_LT(middle, 5 * camera.split_half->median_px);
    EXPECT_LT(camera.sigma->center, 0.1);
    EXPECT_FALSE(camera.remarks.empty());
  }
  EXPECT_GE(report->links.size(), 2u);
  ASSERT_EQ(report->weakest.size(), 2u);
  const std::string html = report_html(rig.views, *solution, *report, "0123");
  for (const char* part :
       {"cam0", "cam2", "<svg", "One sigma of projection", "0123", "Difference of the halves",
        "working distance", "Where the rig comes apart first", "Hardly told apart"}) {
    EXPECT_NE(html.find(part), std::string::npos) << part;
  }
  EXPECT_EQ(html.find("http"), std::string::npos) << "needs something beside it";
  EXPECT_NE(report_json(rig.views, *solution, *report, "0123").find("\"held_out_px\""),
            std::string::npos);
}

// Camera 2 hangs on camera 1 by three sets, which its own link to camera 0 (one set) does not help.
TEST(AssessRig, TheWeakestLinkIsNamed) {
  SyntheticRig rig = make_rig({.cameras = 3, .sets = 45});
  const auto solution = solve_rig(rig.views, {});
  ASSERT_THAT(solution, IsOk());
  RigSolution thin = *solution;
  size_t with_0 = 0, with_1 = 0;
  for (size_t v = 0; v < rig.views.views.size(); ++v) {
    const TargetView& view = rig.views.views[v];
    if (view.camera != 2) continue;
    bool seen_by_0 = false, seen_by_1 = false;
    for (const TargetView& other : rig.views.views) {
      seen_by_0 |= other.set == view.set && other.camera == 0;
      seen_by_1 |= other.set == view.set && other.camera == 1;
    }
    const bool keep = seen_by_0 ? with_0++ < 1 && !seen_by_1 : seen_by_1 && with_1++ < 3;
    if (!keep && (seen_by_0 || seen_by_1)) std::fill(thin.used[v].begin(), thin.used[v].end(), 0);
  }
  const auto report = assess_rig(rig.views, {}, thin);
  ASSERT_THAT(report, IsOk());
  ASSERT_EQ(report->weakest.size(), 2u);
  const LinkReport& weakest = report->links[report->weakest[0]];
  EXPECT_EQ(weakest.a, 1u);
  EXPECT_EQ(weakest.b, 2u);
  EXPECT_EQ(weakest.sets, 3u);
  EXPECT_NE(report_html(rig.views, thin, *report, "0123")
                .find("cam1 and cam2: 3 sets <b class=\"notgood\">(show both the target again)"),
            std::string::npos);
}

// Without tilt worth the name focal length and distance are one, and the report says so.
TEST(AssessRig, WhatTheViewsDoNotTellApartIsNamed) {
  const SyntheticRig rig = make_rig({.cameras = 1, .sets = 20, .nearest = 1, .farthest = 1.4});
  const auto solution = solve_rig(rig.views, {});
  ASSERT_THAT(solution, IsOk());
  const auto report = assess_rig(rig.views, {}, *solution);
  ASSERT_THAT(report, IsOk());
  const std::string html = report_html(rig.views, *solution, *report, "0");
  EXPECT_NE(html.find("fx and fy (0.9"), std::string::npos)
      << html.substr(html.find("Hardly"), 300);
  EXPECT_NE(report_json(rig.views, *solution, *report, "0").find("\"a\": \"fx\""),
            std::string::npos);
}

// A wrong place of one camera shows in what it predicts, though no fit is made.
TEST(AssessRig, HeldOutErrorShowsAMovedCamera) {
  const SyntheticRig rig = make_rig({.cameras = 3, .sets = 30});
  auto solution = solve_rig(rig.views, {});
  ASSERT_THAT(solution, IsOk());
  const std::vector<char> all(rig.views.sets, 1);
  const HeldOut before = held_out_error(rig.views, *solution, all);
  Rigid3& place = solution->cameras[2].camera.world_from_camera;
  place = place * Rigid3::exp((Vector6() << 0, 0.01, 0, 0, 0, 0).finished());
  const HeldOut after = held_out_error(rig.views, *solution, all);
  ASSERT_TRUE(before.by_camera[2] && after.by_camera[2]);
  EXPECT_GT(*after.by_camera[2], 10 * *before.by_camera[2]);
}

// A ring whose neighbors alone share views drifts; tags in its middle hold it together.
TEST(Solve, FixedTagsAreLongRangeLinks) {
  double worst_mm[2] = {0, 0}, claimed_mm[2] = {0, 0};
  for (const size_t pillar : {0, 6}) {
    const test::SyntheticRig rig = test::make_rig({.cameras = 17,
                                                   .sets = 17 * 10,
                                                   .noise_px = 0.3,
                                                   .pillar = pillar,
                                                   .two_at_a_time = true,
                                                   .seed = 4});
    const auto solution = solve_rig(rig.views, {});
    ASSERT_THAT(solution, IsOk());
    const size_t k = pillar > 0;
    for (size_t c = 1; c < 17; ++c) {
      const SolvedCamera& solved = solution->cameras[c];
      const Vector6 d = difference(solved.camera.world_from_camera, rig.truth[c].world_from_camera);
      const Vector6 sigma = solved.place_covariance().diagonal().cwiseSqrt();
      for (int i = 0; i < 6; ++i) EXPECT_LT(std::abs(d[i]), 4 * sigma[i]) << pillar << " " << c;
      worst_mm[k] = std::max(worst_mm[k], 1e3 * d.tail<3>().norm());
      claimed_mm[k] = std::max(claimed_mm[k], 1e3 * sigma.tail<3>().maxCoeff());
    }
    // What is judged with it: halves and lengths do not mix the targets.
    const auto report = assess_rig(rig.views, {}, *solution);
    ASSERT_THAT(report, IsOk());
    ASSERT_TRUE(report->held_out_px);
    EXPECT_LT(*report->held_out_px, 0.8);
    ASSERT_TRUE(report->rigidity);
    EXPECT_NEAR(report->rigidity->scale, 1, 2e-3);
    const auto back = parse_views(format_views(rig.views), "corners.csv");
    ASSERT_THAT(back, IsOk());
    EXPECT_EQ(back->target, rig.views.target);
  }
  EXPECT_LT(claimed_mm[1], 0.97 * claimed_mm[0]);
  EXPECT_LT(worst_mm[1], worst_mm[0]);
  RecordProperty("worst_um_without", static_cast<int>(1e3 * worst_mm[0]));
  RecordProperty("worst_um_with", static_cast<int>(1e3 * worst_mm[1]));
}

TEST(Solve, CornersOfSeveralTargetsHaveTheirOwnFrames) {
  CalibrationTarget target = test::test_target();
  const int own = target.corner_count();
  CalibrationTarget tags;
  tags.kind = TargetKind::kTagGrid;
  tags.columns = 2;
  tags.rows = 1;
  tags.marker = 0.1;
  tags.gap = 0.02;
  tags.dictionary = "tag36h11";
  tags.fixed = true;
  target.others = {tags, tags};
  EXPECT_EQ(target.corner_count(), own + 16);
  EXPECT_EQ(target.corner(own - 1), test::test_target().corner(own - 1));
  EXPECT_EQ(target.corner(own + 3), tags.corner(3));
  EXPECT_EQ(target.corner(own + 8 + 5), tags.corner(5));
  EXPECT_FALSE(target.part(own - 1).fixed);
  EXPECT_TRUE(target.part(own).fixed);
  EXPECT_EQ(target.describe(),
            "chessboard of 10x7 squares of 40 mm; fixed grid of 2x1 tags of 100 "
            "mm, tag36h11 from id 0; fixed grid of 2x1 tags of 100 mm, tag36h11 "
            "from id 0");
}

}  // namespace
}  // namespace sightline
