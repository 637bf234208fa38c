// SPDX-License-Identifier: Apache-2.0
// A search on the clock of a recording: its result comes when its work would have been done.
#include "sightline/pipeline/timed_search.hpp"

#include <gtest/gtest.h>

#include "sightline/pipeline/search_cost.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

const std::filesystem::path kBench =
    std::filesystem::path(SIGHTLINE_SOURCE_DIR) / "recordings" / "bench";

// `bench` without its markers: the carton is found in the first frames, by its print.
class TimedSearchTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    installation_ = std::make_unique<Installation>(recording_installation(kBench).value());
    installation_->objects.front().description.modalities = {false, true, true, true};
    RigOptions options;
    options.cache.clear();
    rig_ = std::make_unique<Rig>(load_rig(*installation_, options).value());
    recording_ = std::make_shared<const Recording>(open_recording(kBench).value());
  }
  static void TearDownTestSuite() {
    rig_.reset();
    installation_.reset();
    recording_.reset();
  }

  // When something was found and of what time it was, for every search of the first `sets`.
  struct Result {
    Time began{}, ended{}, capture{};
    Duration charged{};
    int searches = 0;
  };
  static Result play(double factor, int sets) {
    const auto search = ObjectSearch::create(*installation_, *rig_).value();
    TimedSearch timed(*search, installation_->cameras.size(), factor);
    const auto replay = VirtualReplay::open(recording_).value();
    Result out;
    for (int i = 0; i < sets; ++i) {
      const auto frames = *replay->next().value();
      const Time now = frames.front()->info().capture;
      const auto found = timed.advance(now, {});
      if (!found.empty()) {
        out.ended = now;
        out.capture = found.back().capture;
        break;
      }
      std::vector<CameraFrame> seen;
      for (const FramePtr& frame : frames) seen.push_back({frame->info().camera, frame});
      const bool began = timed.take(seen, {});
      if (began && out.searches++ == 0) out.began = now;
    }
    out.charged = timed.charged();
    return out;
  }

  static inline std::unique_ptr<Installation> installation_;
  static inline std::unique_ptr<Rig> rig_;
  static inline std::shared_ptr<const Recording> recording_;
};

TEST_F(TimedSearchTest, ComesWhenItsWorkIsDoneAndNotBefore) {
  const Result once = play(1, 60);
  ASSERT_NE(once.ended, Time{}) << "found";
  EXPECT_EQ(once.searches, 1) << "none begins while one is under way";
  EXPECT_GT(once.charged, Duration(0));
  EXPECT_GE(once.ended - once.began, once.charged);
  EXPECT_LE(once.ended - once.began, once.charged + std::chrono::milliseconds(34)) << "a period";
}

TEST_F(TimedSearchTest, IsCarriedToWhereTheTrackersTakeOver) {
  const Result found = play(2, 80);
  ASSERT_NE(found.ended, Time{});
  constexpr Duration kFresh = std::chrono::milliseconds(250);
  EXPECT_GT(found.ended - found.began, kFresh) << "then nothing need be carried";
  EXPECT_GT(found.capture, found.began) << "not of the frames that the search began with";
  EXPECT_LT(found.ended - found.capture, kFresh);
}

TEST_F(TimedSearchTest, TheFactorMakesItSlower) {
  const Result fast = play(0.5, 60), slow = play(2, 80), at_once = play(0, 3);
  ASSERT_NE(fast.ended, Time{});
  ASSERT_NE(slow.ended, Time{});
  EXPECT_LT(fast.ended, slow.ended);
  EXPECT_NE(at_once.ended, Time{}) << "in the second set";
  EXPECT_EQ(at_once.charged, Duration(0));
}

TEST(SearchCost, GrowsWithEveryKindOfWork) {
  EXPECT_EQ(search_cost({}), Duration(0));
  for (uint64_t SearchWork::*count :
       {&SearchWork::images, &SearchWork::places, &SearchWork::checked, &SearchWork::scored,
        &SearchWork::masks, &SearchWork::overlaps, &SearchWork::looked_at, &SearchWork::fits,
        &SearchWork::textures, &SearchWork::near_poses}) {
    SearchWork work;
    work.*count = 1'000'000;
    EXPECT_GT(search_cost(work), Duration(0));
  }
}

}  // namespace
}  // namespace sightline
