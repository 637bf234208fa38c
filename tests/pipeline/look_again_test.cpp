// SPDX-License-Identifier: Apache-2.0
// What a search finds that stands out by too little is looked for again at once, about its place.
#include <gtest/gtest.h>

#include "sightline/pipeline/object_search.hpp"
#include "sightline/record/evaluate.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

const std::filesystem::path kOffice =
    std::filesystem::path(SIGHTLINE_SOURCE_DIR) / "recordings" / "office";

struct Office {
  Installation installation;
  std::unique_ptr<ObjectSearch> search;
  std::unique_ptr<VirtualReplay> replay;
  Time start{};

  // The camera in a hand alone: a single search never believes it.
  Office() {
    installation = recording_installation(kOffice).value();
    installation.detect.silhouettes = false;
    std::erase_if(installation.objects,
                  [](const auto& object) { return object.description.name != "camera"; });
    RigOptions options;
    options.cache.clear();
    const Rig rig = load_rig(installation, options).value();
    search = ObjectSearch::create(installation, rig).value();
    const auto recording = std::make_shared<const Recording>(open_recording(kOffice).value());
    replay = VirtualReplay::open(recording).value();
  }

  // Takes the frames up to so long after the first.
  Time show(Duration until) {
    Time now{};
    while (const auto frames = replay->next().value()) {
      now = frames->front()->info().capture;
      if (start == Time{}) start = now;
      for (const FramePtr& frame : *frames) search->add_frame(frame->info().camera, *frame, {});
      if (now - start >= until) break;
    }
    return now;
  }
};

TEST(LookAgain, FindsItInNewerFramesByAThirdOfTheScan) {
  Office office;
  const Time first = office.show(60ms);
  ASSERT_TRUE(office.search->due(first, {}));
  EXPECT_TRUE(office.search->search(first, {}).empty());
  const uint64_t whole = office.search->work().places;
  EXPECT_FALSE(office.search->due(first, {})) << "the same frames say nothing new";

  const Time second = office.show(200ms);
  ASSERT_TRUE(office.search->due(second, {})) << "it waits, however long the interval is";
  const std::vector<Observation> found = office.search->search(second, {});
  const uint64_t again = office.search->work().places - whole;
  ASSERT_FALSE(found.empty());
  EXPECT_LT(3 * again, whole);
  auto truth = read_truth(kOffice / "truth.csv").value();
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
  Office office;
  EXPECT_TRUE(office.search->search(office.show(60ms), {}).empty());
  const uint64_t before = office.search->work().places;
  (void)office.search->search(office.show(1580ms), {});
  EXPECT_GT(2 * (office.search->work().places - before), before) << "everything is searched";
}

TEST(LookAgain, WhereSomebodySaysItIsComesFirst) {
  Office office;
  EXPECT_TRUE(office.search->search(office.show(60ms), {}).empty());
  const Time second = office.show(200ms);
  ASSERT_TRUE(office.search->hint(ObjectId(0), ImageHint{CameraId(0), {320, 240}, 40}));
  const uint64_t before = office.search->work().places;
  (void)office.search->search(second, {});
  EXPECT_GT(2 * (office.search->work().places - before), before) << "its rivals have to be known";
}

TEST(LookAgain, WhatIsForgottenDoesNotWait) {
  Office office;
  const Time first = office.show(60ms);
  EXPECT_TRUE(office.search->search(first, {}).empty());
  ASSERT_TRUE(office.search->forget(ObjectId(0)));
  const Time second = office.show(200ms);
  const uint64_t before = office.search->work().places;
  (void)office.search->search(second, {});
  EXPECT_GT(2 * (office.search->work().places - before), before) << "everything is searched";
}

}  // namespace
}  // namespace sightline
