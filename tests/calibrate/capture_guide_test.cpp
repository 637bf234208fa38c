// SPDX-License-Identifier: Apache-2.0
// A guide and somebody who follows it, or does not.
#include "sightline/calibrate/capture_guide.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "../support/matchers.hpp"
#include "simulated_user.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;
using test::make_rig;
using test::SimulatedUser;
using test::SyntheticRig;

SyntheticRig rig_of(size_t cameras) {
  return make_rig({.cameras = cameras, .sets = 0, .focal = 900, .noise_px = 0.1, .seed = 5});
}

/// The guide, and the solver that runs beside it.
struct Capture {
  explicit Capture(const SyntheticRig& rig, const CaptureGuideOptions& options = {},
                   const std::vector<CameraPrior>& priors = {})
      : guide(rig.views.target, rig.views.cameras, priors, options) {}

  void see(const TargetSight& sight) {
    const auto step = guide.add(sight);
    ASSERT_THAT(step, IsOk());
    ++counts[static_cast<size_t>(step->kind)];
  }
  void solve() {
    const auto solved = solve_rig(guide.views(), {});
    if (!solved) return;
    const auto report = assess_rig(guide.views(), {}, *solved);
    ASSERT_THAT(report, IsOk());
    solution = *solved;
    guide.judge(*solved, *report, guide.views().sets);
  }
  size_t count(CaptureStep::Kind kind) const { return counts[static_cast<size_t>(kind)]; }

  CaptureGuide guide;
  std::array<size_t, 5> counts{};
  std::optional<RigSolution> solution;
};

/// So many poses at most; how many were shown.
size_t follow(Capture& capture, SimulatedUser& user, size_t most) {
  size_t solved_at = 0;
  for (size_t pose = 0; pose < most; ++pose) {
    if (capture.guide.passed()) return pose;
    user.follow(capture.guide.advice(), [&](const TargetSight& sight) { capture.see(sight); });
    const size_t sets = capture.guide.views().sets;
    if (sets > solved_at && (capture.guide.complete() || sets >= solved_at + 5)) {
      capture.solve();
      solved_at = sets;
    }
  }
  return most;
}

TEST(CaptureGuide, WhoFollowsItReachesAGoodReport) {
  for (const size_t cameras : {1, 2, 3, 4}) {
    const SyntheticRig rig = rig_of(cameras);
    Capture capture(rig);
    SimulatedUser user(rig, {});
    EXPECT_EQ(capture.guide.advice().words, "cam0: show it the board in the middle of its picture");
    const size_t poses = follow(capture, user, 30 * cameras + 20);
    EXPECT_TRUE(capture.guide.passed())
        << cameras << " cameras, " << poses << " poses: " << capture.guide.advice().words;
    EXPECT_EQ(capture.guide.advice().kind, CaptureAdvice::Kind::kDone);
    EXPECT_NEAR(capture.guide.share(), 1, 1e-9);
    RecordProperty("poses_" + std::to_string(cameras), static_cast<int>(poses));
    ASSERT_TRUE(capture.solution);
    for (size_t c = 0; c < cameras; ++c) {
      const ParameterEstimate& f = capture.solution->cameras[c].estimates[0];
      EXPECT_LT(std::abs(f.value - rig.truth[c].model.parameters().fx), 5 * f.sigma);
      EXPECT_LT(f.sigma, 3);
    }
  }
}

TEST(CaptureGuide, WhoNeverTiltsIsTold) {
  const SyntheticRig rig = rig_of(2);
  Capture capture(rig);
  SimulatedUser user(rig, {.tilts = false});
  follow(capture, user, 70);
  EXPECT_FALSE(capture.guide.passed());
  const CaptureAdvice advice = capture.guide.advice();
  EXPECT_EQ(advice.kind, CaptureAdvice::Kind::kShow);
  ASSERT_TRUE(advice.tilt);
  EXPECT_NE(advice.words.find("tilted: its "), std::string::npos) << advice.words;
  EXPECT_NE(advice.words.find("edge (in the picture) towards the camera"), std::string::npos);
}

TEST(CaptureGuide, CamerasThatNeverSeeItTogetherAreNamed) {
  const SyntheticRig rig = rig_of(2);
  Capture capture(rig);
  SimulatedUser user(rig, {});
  // One camera is covered while something is shown to it, all but twice.
  size_t pose = 0;
  for (; pose < 80 && capture.guide.advice().kind == CaptureAdvice::Kind::kShow; ++pose) {
    const CaptureAdvice advice = capture.guide.advice();
    const bool both = capture.guide.links(0, 1) < 2;
    user.follow(advice, [&](const TargetSight& sight) {
      TargetSight seen = sight;
      if (!both && seen.camera != advice.camera) seen.corners.clear();
      capture.see(seen);
    });
  }
  const CaptureAdvice advice = capture.guide.advice();
  EXPECT_EQ(advice.kind, CaptureAdvice::Kind::kTogether);
  EXPECT_EQ(advice.words, "cam0 and cam1 have seen it together 2 times, 5 are needed");
  EXPECT_FALSE(capture.guide.complete());
  for (; pose < 100 && !capture.guide.complete(); ++pose) {
    user.follow(capture.guide.advice(), [&](const TargetSight& s) { capture.see(s); });
  }
  EXPECT_TRUE(capture.guide.complete()) << capture.guide.advice().words;
}

TEST(CaptureGuide, TakesWhatIsStillSharpAndNew) {
  const SyntheticRig rig = rig_of(2);
  Capture capture(rig);
  SimulatedUser user(rig, {.held_s = 0});
  const CaptureAdvice first = capture.guide.advice();
  user.follow(first, [&](const TargetSight& sight) { capture.see(sight); });
  EXPECT_EQ(capture.count(CaptureStep::Kind::kTaken), 0u);
  EXPECT_GT(capture.count(CaptureStep::Kind::kMoving), 3u);

  SimulatedUser blurred(rig, {});
  Capture unsharp(rig);
  blurred.follow(first, [&](const TargetSight& sight) {
    TargetSight seen = sight;
    seen.edge_px = 9;
    unsharp.see(seen);
  });
  EXPECT_EQ(unsharp.count(CaptureStep::Kind::kTaken), 0u);
  EXPECT_GT(unsharp.count(CaptureStep::Kind::kBlurred), 0u);

  SimulatedUser patient(rig, {.held_s = 3});
  Capture once(rig);
  patient.follow(first, [&](const TargetSight& sight) { once.see(sight); });
  EXPECT_EQ(once.count(CaptureStep::Kind::kTaken), 1u);
  EXPECT_GT(once.count(CaptureStep::Kind::kKnown), 10u);
  // Corners are means of what was seen, all cameras that saw it are in the set.
  ASSERT_EQ(once.guide.views().sets, 1u);
  EXPECT_EQ(once.guide.views().views.size(), 2u);
}

TEST(CaptureGuide, WhatNoSolverCanUseIsRefused) {
  const SyntheticRig rig = rig_of(1);
  CaptureGuide guide(rig.views.target, rig.views.cameras, {}, {});
  SimulatedUser user(rig, {});
  std::optional<Error> refused;
  user.follow(guide.advice(), [&](const TargetSight& sight) {
    TargetSight mirrored = sight;
    for (TargetCorner& corner : mirrored.corners) corner.pixel.x() = 1279 - corner.pixel.x();
    const auto step = guide.add(mirrored);
    if (!step) refused = step.error();
  });
  ASSERT_TRUE(refused);
  EXPECT_NE(refused->message().find("mirrored"), std::string::npos);
  EXPECT_EQ(guide.views().sets, 0u);
  EXPECT_THAT(guide.set_image_size(0, 640, 480), FailsWith("640x480 now"));
}

TEST(CaptureGuide, AKnownLensNeedsLinksAlone) {
  const SyntheticRig rig = rig_of(2);
  std::vector<CameraPrior> priors;
  for (const CalibratedCamera& camera : rig.truth) {
    priors.push_back({LensModel::kBrownConrady, camera.model});
  }
  Capture capture(rig, {}, priors);
  SimulatedUser user(rig, {});
  size_t poses = 0;
  for (; poses < 30 && !capture.guide.complete(); ++poses) {
    user.follow(capture.guide.advice(), [&](const TargetSight& s) { capture.see(s); });
  }
  EXPECT_LE(poses, 12u);
  EXPECT_TRUE(capture.guide.complete());
}

TEST(CaptureGuide, GoesOnWithAnEarlierCapture) {
  const SyntheticRig rig = rig_of(2);
  Capture capture(rig);
  SimulatedUser user(rig, {});
  follow(capture, user, 4);  // before a solution, which is not in the file
  const auto kept = parse_views(format_views(capture.guide.views()), "corners.csv");
  ASSERT_THAT(kept, IsOk());
  CaptureGuide next(rig.views.target, {{"cam0", 0, 0, 0}, {"cam1", 0, 0, 0}}, {}, {});
  ASSERT_THAT(next.resume(*kept), IsOk());
  EXPECT_EQ(next.views().sets, capture.guide.views().sets);
  EXPECT_EQ(next.links(0, 1), capture.guide.links(0, 1));
  EXPECT_EQ(next.advice().words, capture.guide.advice().words);
  CaptureGuide other(rig.views.target, {{"left", 0, 0, 0}}, {}, {});
  EXPECT_THAT(other.resume(*kept), FailsWith("other cameras"));
}

TEST(CaptureGuide, GoesOnWithACameraThatHadNotGivenAnImage) {
  const SyntheticRig rig = rig_of(1);
  Capture capture(rig);
  SimulatedUser user(rig, {});
  follow(capture, user, 4);
  CalibrationViews views = capture.guide.views();
  views.cameras.push_back({"late", 0, 0, 0});
  const auto kept = parse_views(format_views(views), "corners.csv");
  ASSERT_THAT(kept, IsOk());
  CaptureGuide next(rig.views.target, {{"cam0", 0, 0, 0}, {"late", 0, 0, 0}}, {}, {});
  ASSERT_THAT(next.resume(*kept), IsOk());
  EXPECT_EQ(next.views().sets, views.sets);
  views.cameras.back().width = 640;
  EXPECT_FALSE(parse_views(format_views(views), "corners.csv")) << "half a size is none";
}

// Two cameras out of step, the stamps of one of them late, a target that does not stop.
TEST(CaptureGuide, AMovingTargetGivesTheTimeOffset) {
  const SyntheticRig rig = rig_of(2);
  constexpr double kLate = 0.021;
  CaptureGuide guide(rig.views.target, rig.views.cameras, {}, {.moving = true});
  SimulatedUser user(rig, {});
  const Eigen::Vector2d half = rig.views.target.size() / 2;
  const auto pose_at = [&](double t) {
    const Eigen::Quaterniond turn =
        Eigen::AngleAxisd(0.45 * std::sin(0.83 * t), Eigen::Vector3d::UnitX()) *
        Eigen::AngleAxisd(0.25 + 0.45 * std::cos(0.57 * t), Eigen::Vector3d::UnitY());
    const Eigen::Vector3d middle(0.28 + 0.33 * std::sin(0.71 * t), 0.2 * std::sin(1.13 * t),
                                 1.25 + 0.4 * std::sin(0.37 * t));
    return Rigid3(turn, middle - turn * Eigen::Vector3d(half.x(), half.y(), 0));
  };
  const Duration period = from_seconds(1 / 25.0);
  for (int i = 0; i < 25 * 90; ++i) {
    const Time t = Time(std::chrono::seconds(5)) + i * period;
    for (size_t c = 0; c < 2; ++c) {
      const Time stamp = t + (c == 1 ? period * 2 / 5 : Duration(0));
      const double true_s = to_seconds(stamp.time_since_epoch()) + (c == 1 ? kLate : 0);
      const auto step = guide.add({c, stamp, user.corners(c, pose_at(true_s), 0.1), 2});
      ASSERT_THAT(step, IsOk());
    }
  }
  ASSERT_GT(guide.views().sets, 15u);
  SolveOptions options;
  options.time_offsets = true;
  const auto solved = solve_rig(guide.views(), options);
  ASSERT_THAT(solved, IsOk());
  EXPECT_NEAR(solved->cameras[1].time_offset_s, kLate, 0.001);
}

TEST(CaptureGuide, CellsCountWhatWasSeen) {
  const SyntheticRig rig = rig_of(2);
  Capture capture(rig);
  SimulatedUser user(rig, {});
  const auto share = [&](size_t camera) {
    const CoverageCells cells = capture.guide.coverage(camera);
    EXPECT_EQ(cells.corners.size(), static_cast<size_t>(cells.columns * cells.rows));
    const auto seen = std::ranges::count_if(cells.corners, [](int corners) { return corners > 0; });
    return static_cast<double>(seen) / (cells.columns * cells.rows);
  };
  EXPECT_EQ(share(0), 0);
  follow(capture, user, 6);
  for (size_t camera = 0; camera < 2; ++camera) {
    EXPECT_GT(share(camera), 0) << camera;
    EXPECT_DOUBLE_EQ(share(camera), capture.guide.progress()[camera].coverage) << camera;
    size_t corners = 0, counted = 0;
    for (const TargetView& view : capture.guide.views().views) {
      if (view.camera == camera) corners += view.corners.size();
    }
    for (const int cell : capture.guide.coverage(camera).corners) {
      counted += static_cast<size_t>(cell);
    }
    EXPECT_EQ(counted, corners) << camera;
  }
}

TEST(CaptureGuide, PicturesShowWhatIsWanted) {
  const SyntheticRig rig = rig_of(2);
  Capture capture(rig);
  SimulatedUser user(rig, {});
  follow(capture, user, 3);
  const size_t camera = capture.guide.advice().camera;
  EXPECT_NE(capture.guide.coverage_svg(camera).find("stroke-dasharray"), std::string::npos);
  EXPECT_EQ(capture.guide.coverage_svg(1 - camera).find("stroke-dasharray"), std::string::npos);
  EXPECT_NE(capture.guide.page(false).find("http-equiv=\"refresh\""), std::string::npos);
  EXPECT_EQ(capture.guide.page(true).find("http-equiv=\"refresh\""), std::string::npos);
}

}  // namespace
}  // namespace sightline
