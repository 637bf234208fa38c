// SPDX-License-Identifier: Apache-2.0
#include "sightline/fuse/swap_watch.hpp"

#include <gtest/gtest.h>

#include <array>

namespace sightline {
namespace {

constexpr Duration kFrame = std::chrono::milliseconds(33);

AlikeObject kind(int number) {
  AlikeObject out;
  out.kind = number;
  out.radius = 0.06;
  out.thickness = 0.04;
  return out;
}

/// Objects on a line, by their places on it [m].
class Table {
 public:
  explicit Table(const std::vector<int>& kinds) : tracks_(kinds.size()), watch_(objects(kinds)) {}

  struct Look {
    double x = 0;
    TrackState state = TrackState::kTracking;
    DegradedReasons reasons = 0;
    double sigma = 0.001;
  };
  void step(const std::vector<Look>& looks) {
    time_ += kFrame;
    for (size_t i = 0; i < looks.size(); ++i) {
      const ObjectId id(static_cast<uint32_t>(i));
      PoseEstimate estimate;
      estimate.object = id;
      estimate.time = estimate.last_measured = time_;
      estimate.state = looks[i].state;
      estimate.degraded_reasons = looks[i].reasons;
      estimate.world_from_object.translation.x() = looks[i].x;
      estimate.covariance.diagonal().segment<3>(3).setConstant(looks[i].sigma * looks[i].sigma);
      tracks_[i] =
          std::make_shared<const PoseTrack>(id, std::vector<PoseEstimate>{estimate}, MotionNoise());
    }
    watch_.update(tracks_);
  }
  bool suspected(uint32_t object) const { return watch_.suspected(ObjectId(object)); }
  void forget(uint32_t object) { watch_.forget(ObjectId(object)); }

 private:
  static std::vector<AlikeObject> objects(const std::vector<int>& kinds) {
    std::vector<AlikeObject> out;
    for (const int number : kinds) out.push_back(kind(number));
    return out;
  }
  Time time_{};
  std::vector<PoseTrackPtr> tracks_;
  SwapWatch watch_;
};

constexpr auto kCoasting = TrackState::kCoasting;
constexpr auto kLost = TrackState::kLost;
constexpr auto kDegraded = TrackState::kDegraded;

TEST(SwapWatch, TwoThatPassEachOtherWhileBothAreHeldKeepTheirNames) {
  Table table({0, 0});
  for (int i = 0; i <= 20; ++i) {
    table.step({{-0.5 + 0.05 * i}, {0.05, TrackState::kDegraded, kAmbiguous | kOneCamera}});
    if (std::abs(-0.55 + 0.05 * i) < 0.04) continue;  // one would be inside the other
    EXPECT_FALSE(table.suspected(0) || table.suspected(1)) << i;
  }
}

TEST(SwapWatch, OneThatIsOutOfSightNearTheOtherMayBeEitherFromThenOn) {
  Table table({0, 0, 0, 1});
  table.step({{0}, {0.5}, {2}, {0.1}});
  EXPECT_FALSE(table.suspected(0));
  table.step({{0}, {0.1, kCoasting}, {2}, {0.1}});
  EXPECT_TRUE(table.suspected(0) && table.suspected(1));
  EXPECT_FALSE(table.suspected(2));  // far away
  EXPECT_FALSE(table.suspected(3));  // of another kind
  for (int i = 0; i < 10; ++i) table.step({{0}, {0.5}, {2}, {0.1}});
  EXPECT_TRUE(table.suspected(0) && table.suspected(1));
  table.forget(1);
  table.step({{0}, {0.5}, {2}, {0.1}});
  EXPECT_FALSE(table.suspected(0) || table.suspected(1));
}

TEST(SwapWatch, WhatIsPoorlyKnownNearTheOtherIsSuspectToo) {
  for (const DegradedReason reason : {kSeveralPoses, kWeakPosition, kContradicted, kUnexplained}) {
    Table table({0, 0});
    table.step({{0}, {0.5}});
    table.step({{0, kDegraded, reason}, {0.12}});
    EXPECT_FALSE(table.suspected(0)) << "one frame is not enough to go there";
    table.step({{0, kDegraded, reason}, {0.12}});
    EXPECT_TRUE(table.suspected(0) && table.suspected(1)) << reason;
  }
  Table table({0, 0});
  table.step({{0}, {0.5}});
  table.step({{0, kDegraded, kAmbiguous}, {0.12}});  // its place is known
  EXPECT_FALSE(table.suspected(0) || table.suspected(1));
}

TEST(SwapWatch, OneRefusedFrameSwapsNothing) {
  Table table({0, 0});
  for (int i = 0; i < 50; ++i) {
    const bool refused = i % 5 == 4;
    table.step({{0, refused ? kDegraded : TrackState::kTracking,
                 refused ? DegradedReasons{kContradicted} : DegradedReasons{0}},
                {0.13}});
    ASSERT_FALSE(table.suspected(0) || table.suspected(1)) << i;
  }
}

TEST(SwapWatch, UncertaintyReachesFartherButNotForEver) {
  Table table({0, 0});
  table.step({{0}, {0.5}});
  table.step({{0}, {0.2, kCoasting, 0, 0.01}});
  EXPECT_FALSE(table.suspected(0));
  table.step({{0}, {0.2, kCoasting, 0, 0.03}});
  EXPECT_TRUE(table.suspected(0));
  Table far({0, 0});
  far.step({{0}, {0.5}});
  far.step({{0}, {0.5, kCoasting, 0, 1.0}});
  EXPECT_FALSE(far.suspected(0));
}

TEST(SwapWatch, WhoeverIsLostAloneIsTheOneThatIsFound) {
  Table table({0, 0});
  table.step({{0}, {1}});
  table.step({{0}, {1, kLost}});
  table.step({{0}, {-1}});
  EXPECT_FALSE(table.suspected(0) || table.suspected(1));
}

TEST(SwapWatch, BothLostAtTheSameTimeMayComeBackAsEither) {
  Table table({0, 0});
  table.step({{0, kLost}, {1, kLost}});  // never seen beside each other: names are free
  table.step({{0}, {1}});
  EXPECT_FALSE(table.suspected(0) || table.suspected(1));
  table.step({{0, kLost}, {1, kLost}});
  table.step({{0}, {1}});
  EXPECT_TRUE(table.suspected(0) && table.suspected(1));
}

TEST(SwapWatch, TwoPosesAtOnePlaceAreSuspectAsLongAsThatLasts) {
  Table table({0, 0});
  table.step({{0}, {0.01}});
  EXPECT_TRUE(table.suspected(0) && table.suspected(1));
  table.step({{0}, {0.5}});
  EXPECT_FALSE(table.suspected(0) || table.suspected(1));
}

}  // namespace
}  // namespace sightline
