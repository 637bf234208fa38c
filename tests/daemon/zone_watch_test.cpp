// SPDX-License-Identifier: Apache-2.0
#include "recording/zone_watch.hpp"

#include <gtest/gtest.h>

namespace sightline {
namespace {

using namespace std::chrono_literals;

class Zones : public testing::Test {
 protected:
  Zones() {
    ZoneConfig zone;
    zone.name = "here";
    zone.box = {{0, 0, 0}, {1, 1, 1}};
    zone.objects = {"carton"};
    zone.record = {RecordingKind::kPoses};
    watch_.configure({zone});
  }
  // What is to be recorded of an estimate so long after the first.
  size_t take(Duration at, double x, TrackState state = TrackState::kTracking,
              const char* object = "carton") {
    PoseEstimate estimate;
    estimate.object = ObjectId(0);
    estimate.time = time_from_ns(1'000'000'000) + at;
    estimate.state = state;
    estimate.world_from_object.translation = {x, 0.5, 0.5};
    why_.clear();
    return watch_.take(estimate, object, why_).size();
  }
  bool inside() const {
    const auto all = watch_.inside();
    return all && !all->empty() && all->at(0) == std::vector<std::string>{"here"};
  }

  Registry registry_;
  ZoneWatch watch_{registry_};
  std::string why_;
};

TEST_F(Zones, WhoComesInIsToldOnce) {
  EXPECT_EQ(take(0ms, -0.5), 0u);
  EXPECT_FALSE(inside());
  EXPECT_EQ(take(100ms, 0.5), 1u);
  EXPECT_EQ(why_, "carton entered here");
  EXPECT_TRUE(inside());
  EXPECT_EQ(take(200ms, 0.5), 0u);
}

TEST_F(Zones, WhoStandsOnTheEdgeIsNotToldAgainAndAgain) {
  size_t told = 0;
  for (int i = 0; i < 100; ++i) told += take(i * 33ms, i % 2 == 0 ? 0.001 : -0.001);
  EXPECT_EQ(told, 1u);
  EXPECT_TRUE(inside());
  EXPECT_EQ(take(5s, -0.001), 0u);
  EXPECT_FALSE(inside());
  EXPECT_EQ(take(5s + 33ms, 0.001), 1u);
}

TEST_F(Zones, AGuessIsNoComingIn) {
  EXPECT_EQ(take(0ms, 0.5, TrackState::kCoasting), 0u);
  EXPECT_EQ(take(100ms, 0.5, TrackState::kSearching), 0u);
  EXPECT_EQ(take(200ms, 0.5, TrackState::kDegraded), 1u);
  EXPECT_EQ(take(300ms, 0.5, TrackState::kLost), 0u);
  EXPECT_TRUE(inside());
  EXPECT_EQ(take(1500ms, 0.5, TrackState::kLost), 0u);
  EXPECT_FALSE(inside());
}

TEST_F(Zones, OtherObjectsAreNoneOfItsBusiness) {
  EXPECT_EQ(take(0ms, 0.5, TrackState::kTracking, "crate"), 0u);
  EXPECT_FALSE(inside());
}

TEST_F(Zones, OtherZonesBeginAnew) {
  EXPECT_EQ(take(0ms, 0.5), 1u);
  watch_.configure({});
  EXPECT_EQ(watch_.inside(), nullptr);
  EXPECT_EQ(take(33ms, 0.5), 0u);
  EXPECT_EQ(watch_.inside(), nullptr);
}

// A reload may leave out an object: the next one has its id then.
TEST_F(Zones, ANewObjectOfTheSameIdIsOutsideAtFirst) {
  EXPECT_EQ(take(0ms, 0.5), 1u);
  EXPECT_TRUE(inside());
  EXPECT_EQ(take(33ms, 0.5, TrackState::kTracking, "crate"), 0u);
  EXPECT_FALSE(inside());
  EXPECT_EQ(take(66ms, 0.5), 1u) << "and the one that comes back is told";
}

}  // namespace
}  // namespace sightline
