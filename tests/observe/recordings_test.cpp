// SPDX-License-Identifier: Apache-2.0
// The observer on recordings: against exact truth where there is one.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>

#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/observe/fiducial/fiducial_observer.hpp"
#include "sightline/observe/terms/reprojection_term.hpp"
#include "sightline/record/pose_log.hpp"
#include "sightline/record/recording.hpp"
#include "sightline/record/replay.hpp"
#include "support/matchers.hpp"

namespace sightline {
namespace {

using test::IsOk;

/// What all cameras of a recording see, set by set.
struct Footage {
  std::shared_ptr<const Recording> recording;
  std::vector<CalibratedCamera> cameras;
  std::vector<std::vector<Observation>> sets;
};

void observe_recording(const std::filesystem::path& path, Footage& run) {
  auto recording = open_recording(path);
  ASSERT_THAT(recording, IsOk());
  run.recording = std::make_shared<const Recording>(*std::move(recording));
  auto cameras = read_calibration(run.recording->calibration.value());
  ASSERT_THAT(cameras, IsOk());
  auto object = read_object_file(run.recording->objects.at(0));
  ASSERT_THAT(object, IsOk());
  std::vector<std::unique_ptr<FiducialObserver>> observers;
  for (size_t i = 0; i < run.recording->cameras.size(); ++i) {
    const CalibratedCamera* camera = find_camera(*cameras, run.recording->cameras[i].name);
    ASSERT_NE(camera, nullptr);
    run.cameras.push_back(*camera);
    auto made = FiducialObserver::create(*camera, CameraId(static_cast<uint32_t>(i)),
                                         {{ObjectId(0), *object}});
    ASSERT_THAT(made, IsOk());
    observers.push_back(*std::move(made));
  }
  auto replay = VirtualReplay::open(run.recording);
  ASSERT_THAT(replay, IsOk());
  while (true) {
    auto frames = (*replay)->next();
    ASSERT_THAT(frames, IsOk());
    if (!frames->has_value()) return;
    std::vector<Observation> set;
    for (const FramePtr& frame : **frames) {
      observers[frame->info().camera.index()]->step(*frame, {}, set);
    }
    run.sets.push_back(std::move(set));
  }
}

double percentile(std::vector<double> values, double p) {
  std::sort(values.begin(), values.end());
  return values.at(
      std::min(values.size() - 1, static_cast<size_t>(p * static_cast<double>(values.size()))));
}

/// Best pose of all cameras' terms together.
Rigid3 joint_pose(const std::vector<PoseTermPtr>& terms, Rigid3 pose) {
  for (int i = 0; i < 15; ++i) {
    Matrix6 information = Matrix6::Zero();
    Vector6 gradient = Vector6::Zero();
    for (const PoseTermPtr& term : terms) {
      const LinearizedTerm at = term->linearize(pose);
      information += at.information;
      gradient += at.gradient;
    }
    pose = pose * Rigid3::exp(-information.ldlt().solve(gradient));
  }
  return pose;
}

TEST(Recordings, BenchCornersAndPosesMeetTheTruth) {
  Footage run;
  observe_recording(SIGHTLINE_SOURCE_DIR "/recordings/bench", run);
  if (HasFatalFailure()) return;
  auto truth = read_truth(run.recording->truth.value());
  ASSERT_THAT(truth, IsOk());
  std::map<Time, Rigid3> true_pose;
  for (const TruthRow& row : *truth) true_pose[row.time] = row.world_from_object;

  std::vector<double> corner_px, joint_mm, joint_deg, single_mm;
  double outward_px = 0;
  int tried = 0;
  for (const auto& set : run.sets) {
    std::vector<PoseTermPtr> terms;
    std::vector<PoseHypothesis> starts;
    for (const Observation& o : set) {
      if (o.terms.empty()) continue;
      const Rigid3& pose = true_pose.at(o.capture);
      const CalibratedCamera& camera = run.cameras[o.camera.index()];
      const auto& matches = dynamic_cast<const ReprojectionTerm&>(*o.terms[0]).matches();
      for (size_t k = 0; k < matches.size(); ++k) {
        const auto pixel = camera.model.project(camera.world_from_camera.inverse() *
                                                (pose * matches[k].point_in_object));
        const Eigen::Vector2d error = matches[k].pixel - pixel.value();
        Eigen::Vector2d middle = Eigen::Vector2d::Zero();
        for (size_t j = k / 4 * 4; j < k / 4 * 4 + 4; ++j) middle += matches[j].pixel / 4;
        outward_px += error.dot((matches[k].pixel - middle).normalized());
        corner_px.push_back(error.norm());
      }
      ++tried;
      double best = 1e9;
      for (const PoseHypothesis& h : o.hypotheses) {
        best = std::min(best, translation_distance(h.world_from_object, pose) * 1e3);
        starts.push_back(h);
      }
      single_mm.push_back(best);
      terms.push_back(o.terms[0]);
    }
    if (terms.empty()) continue;
    // From the start that all cameras like best: never from the truth.
    double best_cost = 1e300;
    Rigid3 best;
    for (const PoseHypothesis& start : starts) {
      const Rigid3 pose = joint_pose(terms, start.world_from_object);
      double cost = 0;
      for (const PoseTermPtr& term : terms) cost += term->linearize(pose).cost;
      if (cost < best_cost) {
        best_cost = cost;
        best = pose;
      }
    }
    const Rigid3& pose = true_pose.at(set.front().capture);
    joint_mm.push_back(translation_distance(best, pose) * 1e3);
    joint_deg.push_back(rotation_angle(best, pose) * 180 / std::numbers::pi);
  }
  EXPECT_GE(tried, 180);
  EXPECT_EQ(joint_mm.size(), 90u);
  EXPECT_LT(percentile(corner_px, 0.5), 0.1);
  EXPECT_LT(percentile(corner_px, 0.95), 0.25);
  EXPECT_NEAR(outward_px / static_cast<double>(corner_px.size()), 0, 0.05);
  EXPECT_LT(percentile(single_mm, 0.5), 4.0);
  EXPECT_LT(percentile(joint_mm, 0.5), 0.8);
  EXPECT_LT(percentile(joint_mm, 0.95), 2.0);
  EXPECT_LT(percentile(joint_deg, 0.5), 0.3);
  EXPECT_LT(percentile(joint_deg, 0.95), 0.8);
}

/// Share of the frames in which a board is found, and how well its corners fit one pose.
struct BoardStudy {
  int frames = 0, seen = 0;
  double rms_px = 0;  ///< of one coordinate, per degree of freedom
};
BoardStudy study_board(const Footage& run) {
  BoardStudy out;
  double sum = 0;
  int freedom = 0;
  for (const auto& set : run.sets) {
    for (const Observation& o : set) {
      ++out.frames;
      if (o.terms.empty() || o.hypotheses.empty()) continue;
      ++out.seen;
      const CalibratedCamera& camera = run.cameras[o.camera.index()];
      const auto& matches = dynamic_cast<const ReprojectionTerm&>(*o.terms[0]).matches();
      for (const PointMatch& m : matches) {
        const auto pixel =
            camera.model.project(camera.world_from_camera.inverse() *
                                 (o.hypotheses[0].world_from_object * m.point_in_object));
        sum += (pixel.value() - m.pixel).squaredNorm();
      }
      freedom += 2 * static_cast<int>(matches.size()) - 6;
    }
  }
  out.rms_px = std::sqrt(sum / freedom);
  return out;
}

TEST(Recordings, BoardOfTheCalibrationRecording) {
  const std::filesystem::path path = SIGHTLINE_SOURCE_DIR "/../shared/recordings/bench-calibration";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no " << path;
  Footage run;
  observe_recording(path, run);
  if (HasFatalFailure()) return;
  const BoardStudy study = study_board(run);
  EXPECT_EQ(study.frames, 45);
  EXPECT_EQ(study.seen, 45);
  EXPECT_LT(study.rms_px, 0.15);
}

TEST(Recordings, InvertedBoardOfRealFootage) {
  const std::filesystem::path path = SIGHTLINE_SOURCE_DIR "/../shared/recordings/board";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no " << path;
  Footage run;
  observe_recording(path, run);
  if (HasFatalFailure()) return;
  const BoardStudy study = study_board(run);
  EXPECT_EQ(study.frames, 228);
  EXPECT_GE(study.seen, 165);  // without any prediction
  EXPECT_LT(study.rms_px, 0.25);
}

}  // namespace
}  // namespace sightline
