// SPDX-License-Identifier: Apache-2.0
// Real footage: four webcams that run freely at 6 frames per second, stamps and calibration as
// published, a hand-held board. No truth, so the cameras judge one another.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/fuse/estimator.hpp"
#include "sightline/observe/fiducial/fiducial_observer.hpp"
#include "sightline/observe/terms/reprojection_term.hpp"
#include "sightline/record/recording.hpp"
#include "sightline/record/replay.hpp"
#include "support/matchers.hpp"

namespace sightline {
namespace {

using test::IsOk;

constexpr size_t kCameras = 4;
constexpr size_t kEnoughCorners = 6;

struct Sight {
  Observation observation;
  std::shared_ptr<const ReprojectionTerm> corners;  // null: not enough of them
};

void observe_board(const std::filesystem::path& path, std::vector<Sight>& sights) {
  auto opened = open_recording(path);
  ASSERT_THAT(opened, IsOk());
  const auto recording = std::make_shared<const Recording>(*std::move(opened));
  auto cameras = read_calibration(recording->calibration.value());
  ASSERT_THAT(cameras, IsOk());
  auto object = read_object_file(recording->objects.at(0));
  ASSERT_THAT(object, IsOk());
  std::vector<std::unique_ptr<FiducialObserver>> observers;
  for (size_t i = 0; i < kCameras; ++i) {
    const CalibratedCamera* camera = find_camera(*cameras, recording->cameras.at(i).name);
    ASSERT_NE(camera, nullptr);
    auto made = FiducialObserver::create(*camera, CameraId(static_cast<uint32_t>(i)),
                                         {{ObjectId(0), *object}});
    ASSERT_THAT(made, IsOk());
    observers.push_back(*std::move(made));
  }
  auto replay = VirtualReplay::open(recording);
  ASSERT_THAT(replay, IsOk());
  for (;;) {
    auto frames = (*replay)->next();
    ASSERT_THAT(frames, IsOk());
    if (!frames->has_value()) return;
    std::vector<Observation> made;
    for (const FramePtr& frame : **frames) {
      observers[frame->info().camera.index()]->step(*frame, {}, made);
    }
    for (Observation& observation : made) {
      Sight sight{std::move(observation), nullptr};
      if (!sight.observation.terms.empty()) {
        auto corners =
            std::dynamic_pointer_cast<const ReprojectionTerm>(sight.observation.terms.front());
        if (corners->matches().size() >= kEnoughCorners) sight.corners = std::move(corners);
      }
      sights.push_back(std::move(sight));
    }
  }
}

/// Root mean square reprojection error [px].
double reprojection(const ReprojectionTerm& term, const Rigid3& world_from_object) {
  const Rigid3 camera_from_object = term.camera().world_from_camera.inverse() * world_from_object;
  double sum = 0;
  for (const PointMatch& match : term.matches()) {
    const auto pixel = term.camera().model.project(camera_from_object * match.point_in_object);
    sum += pixel ? (*pixel - match.pixel).squaredNorm() : 1e6;
  }
  return std::sqrt(sum / static_cast<double>(term.matches().size()));
}

/// Of one camera's corners under the poses from the others: each frame waits until the others have
/// been past it, and takes the best known pose of the round.
double median_left_out(const std::vector<Sight>& sights, CameraId left_out) {
  constexpr Duration kRound = std::chrono::milliseconds(40);
  auto estimator = ObjectEstimator::create({}, ObjectId(0)).value();
  std::vector<double> errors;
  std::vector<const Sight*> waiting;
  for (const Sight& sight : sights) {
    if (sight.observation.camera == left_out) {
      if (sight.corners) waiting.push_back(&sight);
      continue;
    }
    for (const Sight* seen : waiting) {
      const Time time = seen->observation.capture;
      if (time + kRound >= sight.observation.capture) continue;
      std::optional<PoseEstimate> best;
      for (const PoseEstimate& estimate : estimator.track()->history()) {
        if (estimate.state == TrackState::kCoasting || !has_pose(estimate.state)) continue;
        if (estimate.time < time - kRound || estimate.time > time + kRound) continue;
        const PoseEstimate moved = predict(estimate, time, estimator.options().noise);
        if (!best || moved.pose_covariance().trace() < best->pose_covariance().trace()) {
          best = moved;
        }
      }
      if (best) errors.push_back(reprojection(*seen->corners, best->world_from_object));
    }
    std::erase_if(waiting, [&](const Sight* seen) {
      return seen->observation.capture + kRound < sight.observation.capture;
    });
    estimator.process({&sight.observation, 1});
  }
  if (errors.size() < 8) return 1e9;
  std::nth_element(errors.begin(), errors.begin() + static_cast<ptrdiff_t>(errors.size() / 2),
                   errors.end());
  return errors[errors.size() / 2];
}

TEST(Board, TracksWhatItsCamerasSee) {
  const std::filesystem::path path = SIGHTLINE_SOURCE_DIR "/../shared/recordings/board";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not there";
  std::vector<Sight> sights;
  observe_board(path, sights);
  if (HasFatalFailure()) return;

  auto estimator = ObjectEstimator::create({}, ObjectId(0)).value();
  int seen = 0, tracking = 0;
  double fastest = 0;
  for (const Sight& sight : sights) {
    const PoseEstimate estimate = estimator.process({&sight.observation, 1}).estimate;
    if (!sight.corners) continue;
    ++seen;
    tracking += estimate.state == TrackState::kTracking ? 1 : 0;
    // Two seconds to learn what the cameras are like; the board moves at up to 0.25 m/s.
    if (estimate.time < sights.front().observation.capture + std::chrono::seconds(2)) continue;
    fastest = std::max(fastest, estimate.twist.tail<3>().norm());
  }
  std::printf("tracking in %d of %d, gated %d, fastest %.2f m/s\n", tracking, seen,
              static_cast<int>(estimator.counters().gated), fastest);
  EXPECT_GE(seen, 165);
  EXPECT_GE(tracking * 100, seen * 96);
  EXPECT_LE(estimator.counters().gated, 2u);
  EXPECT_EQ(estimator.counters().resets, 0u);
  EXPECT_LT(fastest, 0.6);

  const double limit_px[kCameras] = {3.5, 6.5, 3.5, 3.0};
  for (uint32_t i = 0; i < kCameras; ++i) {
    const double median = median_left_out(sights, CameraId(i));
    std::printf("camera %u left out: median %.2f px\n", i, median);
    EXPECT_LT(median, limit_px[i]) << "camera " << i;
  }
}

}  // namespace
}  // namespace sightline
