// SPDX-License-Identifier: Apache-2.0
// What a search finds that stands out by too little is looked for again at once, about its place.
#include <gtest/gtest.h>

#include "sightline/pipeline/object_search.hpp"
#include "sightline/record/evaluate.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

std::filesystem::path recording_path(const std::string& name) {
  return std::filesystem::path(SIGHTLINE_SOURCE_DIR) / "recordings" / name;
}

// One object of a recording alone, from some time after its start on: its first search there finds
// it, and does not believe it.
struct Scene {
  Installation installation;
  std::unique_ptr<ObjectSearch> search;
  std::unique_ptr<VirtualReplay> replay;
  Time start{};
  Duration from;

  Scene(const std::string& name, const std::string& object, Duration begin) : from(begin) {
    installation = recording_installation(recording_path(name)).value();
    installation.detect.silhouettes = false;
    std::erase_if(installation.objects,
                  [&](const auto& other) { return other.description.name != object; });
    RigOptions options;
    options.cache.clear();
    const Rig rig = load_rig(installation, options).value();
    search = ObjectSearch::create(installation, rig).value();
    replay = VirtualReplay::open(
                 std::make_shared<const Recording>(open_recording(recording_path(name)).value()))
                 .value();
  }

  // Takes the frames up to so long after `from`.
  Time show(Duration until) {
    Time now{};
    while (const auto frames = replay->next().value()) {
      now = frames->front()->info().capture;
      if (start == Time{}) start = now;
      if (now - start < from) continue;
      for (const FramePtr& frame : *frames) search->add_frame(frame->info().camera, *frame, {});
      if (now - start >= from + until) break;
    }
    return now;
  }
};

// The camera in a hand, late enough that its score is low.
Scene office() { return {"office", "camera", 1200ms}; }

TEST(LookAgain, FindsItInNewerFramesByAThirdOfTheScan) {
  Scene scene = office();
  const Time first = scene.show(60ms);
  ASSERT_TRUE(scene.search->due(first, {}));
  EXPECT_TRUE(scene.search->search(first, {}).empty());
  const uint64_t whole = scene.search->work().places;
  EXPECT_FALSE(scene.search->due(first, {})) << "the same frames say nothing new";

  const Time second = scene.show(200ms);
  ASSERT_TRUE(scene.search->due(second, {})) << "it waits, however long the interval is";
  const std::vector<Observation> found = scene.search->search(second, {});
  const uint64_t again = scene.search->work().places - whole;
  ASSERT_FALSE(found.empty());
  EXPECT_LT(3 * again, whole);
  auto truth = read_truth(recording_path("office") / "truth.csv").value();
  std::erase_if(truth, [](const TruthRow& row) { return row.object != "camera"; });
  for (const Observation& observation : found) {
    const auto there = truth_at(truth, observation.capture, 200ms);
    ASSERT_TRUE(there);
    const Rigid3& pose = observation.hypotheses.front().world_from_object;
    EXPECT_LT(translation_distance(pose, *there), 0.03);
    EXPECT_LT(rotation_angle(pose, *there), 0.26);
  }
}

TEST(LookAgain, NotAtAPlaceOfLongAgo) {
  const auto second_search = [](Duration at) {
    Scene scene("garage", "gluegun", 40ms);
    EXPECT_TRUE(scene.search->search(scene.show(60ms), {}).empty());
    const uint64_t before = scene.search->work().places;
    (void)scene.search->search(scene.show(at), {});
    return static_cast<double>(scene.search->work().places - before) / static_cast<double>(before);
  };
  EXPECT_LT(second_search(200ms), 1.0 / 3) << "it waits";
  EXPECT_GT(second_search(1640ms), 0.5) << "everything is searched";
}

TEST(LookAgain, WhereSomebodySaysItIsComesFirst) {
  Scene scene = office();
  EXPECT_TRUE(scene.search->search(scene.show(60ms), {}).empty());
  const Time second = scene.show(200ms);
  ASSERT_TRUE(scene.search->hint(ObjectId(0), ImageHint{CameraId(0), {320, 240}, 40}));
  const uint64_t before = scene.search->work().places;
  (void)scene.search->search(second, {});
  EXPECT_GT(2 * (scene.search->work().places - before), before) << "its rivals have to be known";
}

TEST(LookAgain, WhatIsForgottenDoesNotWait) {
  Scene scene = office();
  const Time first = scene.show(60ms);
  EXPECT_TRUE(scene.search->search(first, {}).empty());
  ASSERT_TRUE(scene.search->forget(ObjectId(0)));
  const Time second = scene.show(200ms);
  const uint64_t before = scene.search->work().places;
  (void)scene.search->search(second, {});
  EXPECT_GT(2 * (scene.search->work().places - before), before) << "everything is searched";
}

}  // namespace
}  // namespace sightline
