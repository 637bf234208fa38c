// SPDX-License-Identifier: Apache-2.0
// Two objects that look the same, in a rendered recording in which they pass and hide one another.
#include <gtest/gtest.h>

#include "sightline/pipeline/object_search.hpp"
#include "sightline/pipeline/replay_pipeline.hpp"
#include "sightline/record/evaluate.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

const std::filesystem::path kTwins =
    std::filesystem::path(SIGHTLINE_SOURCE_DIR) / "recordings" / "twins";

// The searches of the recording, with the tracks that a test makes up.
struct Twins {
  Twins() {
    Installation installation = recording_installation(kTwins).value();
    installation.detect.silhouettes = false;
    RigOptions options;
    options.cache.clear();
    const Rig rig = load_rig(installation, options).value();
    center = rig.objects.front().views->center();
    search = ObjectSearch::create(installation, rig).value();
    const auto recording = std::make_shared<const Recording>(open_recording(kTwins).value());
    replay = VirtualReplay::open(recording).value();
    for (size_t i = 0; i < 2; ++i) {
      truth[i] = read_truth(kTwins / "truth.csv").value();
      std::erase_if(truth[i], [&](const TruthRow& row) { return row.object != kNames[i]; });
    }
  }

  // Says that an object is, at any time, where `of` truly is.
  PoseTrackPtr track(size_t object, size_t of) const {
    std::vector<PoseEstimate> estimates;
    for (const TruthRow& row : truth[of]) {
      PoseEstimate estimate;
      estimate.time = estimate.last_measured = row.time;
      estimate.state = TrackState::kTracking;
      estimate.world_from_object = row.world_from_object;
      estimates.push_back(estimate);
    }
    return std::make_shared<const PoseTrack>(ObjectId(static_cast<uint32_t>(object)), estimates,
                                             MotionNoise());
  }

  // What the first search or check of the recording that finds anything has found.
  std::vector<Observation> first_found(const std::vector<PoseTrackPtr>& tracks) {
    while (const auto frames = replay->next().value()) {
      const Time now = frames->front()->info().capture;
      for (const FramePtr& frame : *frames) search->add_frame(frame->info().camera, *frame, tracks);
      if (!search->complete(now) || !search->due(now, tracks)) continue;
      auto found = search->search(now, tracks);
      if (!found.empty()) return found;
    }
    return {};
  }

  // Of the middle of what was found from that of one of them [m], the most over the cameras.
  double distance(const std::vector<Observation>& found, size_t of) const {
    double most = 0;
    for (const Observation& observation : found) {
      const auto there = truth_at(truth[of], observation.capture, 200ms);
      if (!there) continue;
      const Rigid3& pose = observation.hypotheses.front().world_from_object;
      most = std::max(most, (pose * center - *there * center).norm());
    }
    return most;
  }

  static constexpr std::array kNames = {"piga", "pigb"};
  std::unique_ptr<ObjectSearch> search;
  std::unique_ptr<VirtualReplay> replay;
  std::array<std::vector<TruthRow>, 2> truth;
  Eigen::Vector3d center;
};

TEST(Twins, TheSecondIsNotFoundWhereTheFirstIs) {
  for (size_t known = 0; known < 2; ++known) {
    Twins twins;
    std::vector<PoseTrackPtr> tracks(2);
    tracks[0] = twins.track(0, known);
    const auto found = twins.first_found(tracks);
    ASSERT_FALSE(found.empty());
    EXPECT_EQ(found.front().object, ObjectId(1));
    EXPECT_LT(twins.distance(found, 1 - known), 0.03);
  }
}

TEST(Twins, WhatHasJustBeenFoundIsNotFoundAgain) {
  Twins twins;
  // No track begins, so that the first may be found again before the second is.
  std::vector<Observation> before, found = twins.first_found({});
  const ObjectId first = found.empty() ? ObjectId(0) : found.front().object;
  while (!found.empty() && found.front().object == first) {
    before = std::move(found);
    found = twins.first_found({});
  }
  ASSERT_FALSE(before.empty());
  ASSERT_FALSE(found.empty());
  const size_t place = twins.distance(before, 0) < 0.03 ? 0 : 1;
  EXPECT_LT(twins.distance(before, place), 0.03);
  EXPECT_LT(twins.distance(found, 1 - place), 0.03);
}

TEST(Twins, TwoAtOnePlaceComeApart) {
  Twins twins;
  const auto found = twins.first_found({twins.track(0, 0), twins.track(1, 0)});
  ASSERT_FALSE(found.empty());
  EXPECT_LT(twins.distance(found, 1), 0.03);
  for (const Observation& observation : found) EXPECT_TRUE(observation.refutes);
}

// The whole replay, each search charged with its time: both are found from nothing, kept while they
// hide one another, and never taken for one another.
TEST(Twins, AreFoundAndKeptApart) {
  const auto recording = std::make_shared<const Recording>(open_recording(kTwins).value());
  const Installation installation = recording_installation(kTwins).value();
  auto frames = VirtualReplay::open(recording).value();
  auto pipeline = ReplayPipeline::create(installation, recording, nullptr, {}, {}).value();
  const auto truth = read_truth(kTwins / "truth.csv").value();
  std::vector<PoseLogRow> rows;
  while (const auto set = frames->next().value()) {
    ASSERT_TRUE(pipeline->step(*set).has_value());
    const Time now = pipeline->frames().front()->info().capture;
    for (size_t i = 0; i < 2; ++i) {
      const PoseAt at = pipeline->tracks()[i]->at(now);
      PoseLogRow row;
      row.time = now;
      row.object = Twins::kNames[i];
      row.state = at.source == PoseSource::kNone ? TrackState::kSearching : at.estimate.state;
      if (has_pose(row.state)) row.world_from_object = at.estimate.world_from_object;
      rows.push_back(row);
    }
  }
  EvaluateOptions options;
  options.alike = {{"piga", "pigb"}};
  for (const ObjectEvaluation& object : evaluate(truth, rows, options).objects) {
    std::printf("%s, logged as %s: %.1f %% within 5 cm + 5 deg, median %.2f mm\n",
                object.object.c_str(), object.logged_as.c_str(), 100 * object.success(),
                object.all.median_mm);
    EXPECT_GT(object.success(), 0.6);
    EXPECT_LT(object.all.median_mm, 1.5);
    EXPECT_TRUE(object.wrong_claims.empty());
  }
}

}  // namespace
}  // namespace sightline
