// SPDX-License-Identifier: Apache-2.0
// Calibrations of real and rendered footage, against what is known of it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "../support/matchers.hpp"
#include "calibrate/report/split_half.hpp"
#include "sightline/calibrate/assess.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/calibrate/target_file.hpp"
#include "sightline/pipeline/target_views.hpp"
#include "sightline/record/evaluate.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;

const std::filesystem::path kShared = std::filesystem::path(SIGHTLINE_SOURCE_DIR) / "../shared";

std::optional<std::filesystem::path> shared(const std::string& name) {
  const auto path = kShared / "recordings" / name;
  if (!std::filesystem::exists(path)) return std::nullopt;
  return path;
}

Result<CalibrationViews> recorded_views(const std::filesystem::path& recording) {
  const auto target = read_target(recording / "objects/board.toml");
  if (!target) return target.error();
  return views_of_recording(recording, *target, {});
}

// Three solvers agree on this optimum: OpenCV, mrcal and Ceres (0.215046 px, window 5).
TEST(Recordings, ClassicStereoPairs) {
  const std::string data = "/usr/share/doc/opencv-doc/examples/data";
  if (!std::filesystem::exists(data + "/left01.jpg")) GTEST_SKIP() << "no opencv-doc";
  CalibrationTarget target;
  target.kind = TargetKind::kChessboard;
  target.columns = 10;
  target.rows = 7;
  target.square = 1;
  std::vector<CameraStills> stills;
  for (const char* side : {"left", "right"}) {
    auto camera = parse_stills(std::string(side) + "=" + data + "/" + side + "[01][0-9].jpg");
    ASSERT_THAT(camera, IsOk());
    EXPECT_EQ(camera->files.size(), 13u);
    stills.push_back(*camera);
  }
  TargetViewsOptions looking;
  looking.window = 5;
  const auto views = views_of_stills(stills, target, looking);
  ASSERT_THAT(views, IsOk());
  SolveOptions options;
  options.reject_sigmas = 0;
  const auto solution = solve_rig(*views, options);
  ASSERT_THAT(solution, IsOk());
  EXPECT_NEAR(solution->rms_px, 0.215046, 1e-4);
  EXPECT_NEAR(solution->cameras[1].camera.world_from_camera.translation.norm(), 3.32726, 1e-3);
  const auto report = assess_rig(*views, options, *solution);
  ASSERT_THAT(report, IsOk());
  ASSERT_TRUE(report->held_out_px);
  EXPECT_LE(*report->held_out_px, 0.31);
}

TEST(Recordings, RenderedBoardAgainstItsTruth) {
  const auto recording = shared("bench-calibration");
  if (!recording) GTEST_SKIP() << "no " << kShared << "/recordings/bench-calibration";
  const auto views = recorded_views(*recording);
  ASSERT_THAT(views, IsOk());
  const auto solution = solve_rig(*views, {});
  ASSERT_THAT(solution, IsOk());
  const auto truth = read_calibration(*recording / "calibration.toml");
  ASSERT_THAT(truth, IsOk());
  const Rigid3 reference_from_world = truth->front().world_from_camera.inverse();
  for (size_t c = 0; c < 3; ++c) {
    const SolvedCamera& solved = solution->cameras[c];
    const CameraModel::Parameters& p = (*truth)[c].model.parameters();
    const double expected[] = {p.fx, p.fy, p.cx, p.cy};
    for (size_t i = 0; i < 4; ++i) {
      EXPECT_LT(std::abs(solved.estimates[i].value - expected[i]), 3 * solved.estimates[i].sigma)
          << solved.camera.name << " " << solved.estimates[i].name;
    }
    const Rigid3 place = reference_from_world * (*truth)[c].world_from_camera;
    if (c > 0) {
      const Vector6 d = difference(solved.camera.world_from_camera, place);
      const Vector6 sigma = solved.place_covariance().diagonal().cwiseSqrt();
      for (int i = 0; i < 6; ++i) EXPECT_LT(std::abs(d[i]), 3 * sigma[i]) << c << " " << i;
    }
  }
  // What both project of the target, where it truly was.
  const auto rows = read_truth(*recording / "truth.csv");
  ASSERT_THAT(rows, IsOk());
  ASSERT_EQ(rows->size(), views->sets);
  RigSolution exact = *solution;
  for (size_t c = 0; c < 3; ++c) exact.cameras[c].camera = (*truth)[c];
  for (size_t set = 0; set < views->sets; ++set) {
    exact.world_from_target[set] = (*rows)[set].world_from_object;
  }
  for (const SplitHalf& off : calibrate::compare(*views, exact, exact, *solution)) {
    EXPECT_LE(off.median_px, 0.1);
  }
}

TEST(Recordings, RealBoardWithKnownLenses) {
  const auto recording = shared("board");
  if (!recording) GTEST_SKIP() << "no " << kShared << "/recordings/board";
  const auto views = recorded_views(*recording);
  ASSERT_THAT(views, IsOk());
  const auto published = read_calibration(*recording / "calibration.toml");
  ASSERT_THAT(published, IsOk());
  SolveOptions options;
  options.time_offsets = true;
  for (const ViewedCamera& camera : views->cameras) {
    options.cameras.push_back(
        {LensModel::kBrownConrady, find_camera(*published, camera.name)->model});
  }
  const auto solution = solve_rig(*views, options);
  ASSERT_THAT(solution, IsOk());
  const auto report = assess_rig(*views, options, *solution);
  ASSERT_THAT(report, IsOk());
  ASSERT_TRUE(report->rigidity);
  EXPECT_LE(report->rigidity->rms_mm, 1.1);
  for (const CameraReport& camera : report->cameras) {
    ASSERT_TRUE(camera.split_half);
    EXPECT_LE(camera.split_half->center_mm, 6) << camera.name;
  }
  // The published places leave more of the target's lengths unexplained.
  const auto before = rigidity(*views, *published);
  ASSERT_TRUE(before);
  EXPECT_LT(report->rigidity->rms_mm, before->rms_mm);
}

TEST(Recordings, WrongTargetIsRefusedByName) {
  const auto recording = shared("bench-calibration");
  if (!recording) GTEST_SKIP() << "no " << kShared << "/recordings/bench-calibration";
  auto target = read_target(*recording / "objects/board.toml");
  ASSERT_THAT(target, IsOk());
  TargetViewsOptions options;
  options.cameras = {"left"};
  options.every = 3;
  target->layout = CharucoLayout::kMarkerFirst;
  EXPECT_THAT(views_of_recording(*recording, *target, options),
              FailsWith("the print has the other layout for its even number of rows"));
  target->layout = CharucoLayout::kAny;
  target->dictionary = "6X6_250";
  EXPECT_THAT(views_of_recording(*recording, *target, options),
              FailsWith("of 5X5_50 (or a larger one of its kind)"));
  target->dictionary = "5X5_100";
  target->columns = 11;
  EXPECT_THAT(views_of_recording(*recording, *target, options),
              FailsWith("are columns and rows right?"));
}

}  // namespace
}  // namespace sightline
