// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/cell/track_follower.hpp"

#include <gtest/gtest.h>

namespace sightline {
namespace {

using namespace std::chrono_literals;

PoseEstimate tracked(Duration at) {
  PoseEstimate estimate;
  estimate.time = estimate.last_measured = Time(10s) + at;
  estimate.state = TrackState::kTracking;
  estimate.twist[3] = 1.0;
  estimate.world_from_object.translation.x() = to_seconds(at);
  estimate.covariance = 1e-6 * decltype(estimate.covariance)::Identity();
  return estimate;
}

TEST(TrackFollower, KeepsTheOrderOfTime) {
  TrackFollower follower(ObjectId(2), {});
  EXPECT_TRUE(follower.track()->empty());
  EXPECT_TRUE(follower.take(tracked(0ms)));
  EXPECT_TRUE(follower.take(tracked(30ms)));
  EXPECT_FALSE(follower.take(tracked(10ms)));
  EXPECT_TRUE(follower.take(tracked(30ms)));  // another camera's frame of the same time has joined
  const auto track = follower.track();
  EXPECT_EQ(track->history().size(), 2U);
  EXPECT_EQ(track->newest().object, ObjectId(2));
  EXPECT_NEAR(track->at(Time(10s) + 40ms).estimate.world_from_object.translation.x(), 0.04, 1e-9);
}

TEST(TrackFollower, SilenceEndsWhatIsClaimed) {
  TrackFollower follower(ObjectId(0), {});
  follower.take(tracked(0ms));
  EXPECT_FALSE(follower.advance(Time(10s) + 200ms));
  EXPECT_EQ(follower.advance(Time(10s) + 400ms)->state, TrackState::kCoasting);
  EXPECT_FALSE(follower.advance(Time(10s) + 450ms));
  EXPECT_EQ(follower.track()->at(Time(10s) + 420ms).estimate.state, TrackState::kCoasting);
  EXPECT_EQ(follower.advance(Time(10s) + 750ms)->state, TrackState::kLost);
  EXPECT_EQ(follower.track()->at(Time(10s) + 800ms).source, PoseSource::kNone);
  EXPECT_EQ(follower.advance(Time(10s) + 11s)->state, TrackState::kSearching);
  EXPECT_FALSE(follower.advance(Time(10s) + 12s));
  EXPECT_TRUE(follower.take(tracked(12s)));
  EXPECT_EQ(follower.track()->newest().state, TrackState::kTracking);
}

// What was made up of silence gives way to a measurement, even one that is older.
TEST(TrackFollower, ALateEstimateIsBetterThanNone) {
  TrackFollower follower(ObjectId(0), {});
  follower.take(tracked(0ms));
  ASSERT_TRUE(follower.advance(Time(10s) + 400ms));
  EXPECT_TRUE(follower.take(tracked(300ms)));
  EXPECT_EQ(follower.track()->newest().state, TrackState::kTracking);
}

TEST(TrackFollower, GoesOnFromWhatWasKnownBefore) {
  TrackFollower before(ObjectId(1), {}), follower(ObjectId(1), {});
  for (int i = 0; i < 10; ++i) before.take(tracked(i * 10ms));
  follower.take(tracked(500ms));
  follower.restart(before.track().get(), Time(10s) + 50ms);
  EXPECT_EQ(follower.track()->newest().time, Time(10s) + 40ms);
  EXPECT_TRUE(follower.take(tracked(50ms)));
  EXPECT_EQ(follower.track()->history().size(), 6U);
  follower.restart(nullptr, Time(10s));
  EXPECT_TRUE(follower.track()->empty());
}

TEST(TrackFollower, KeepsNoMoreThanItNeeds) {
  TrackFollower follower(ObjectId(0), {});
  for (int i = 0; i < 1000; ++i) follower.take(tracked(i * 5ms));
  EXPECT_EQ(follower.track()->history().size(), TrackFollower::kKept);
}

}  // namespace
}  // namespace sightline
