// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/judge/weak_detections.hpp"

#include <gtest/gtest.h>

namespace sightline::observe {
namespace {

// A pose that has been found at `seconds`, `x` along.
Detection found(double seconds, double x, double score, double rival) {
  Detection out;
  out.time = Time() + from_seconds(seconds);
  Rigid3 pose;
  pose.translation = {x, 0, 1};
  out.poses.push_back({pose, Vector6::Zero(), score, 2});
  out.runner_up = rival * score;
  return out;
}

struct Row : testing::Test {
  WeakDetections weak{Eigen::Vector3d::Zero(), 0.1};
};

TEST_F(Row, TwoThatStandOutAreEnough) {
  EXPECT_FALSE(weak.confirms(found(0, 0, 0.65, 0.8)));
  EXPECT_TRUE(weak.confirms(found(0.2, 0.1, 0.65, 0.8)));
  EXPECT_FALSE(weak.confirms(found(0.4, 0.2, 0.65, 0.8))) << "it starts anew";
}

TEST_F(Row, OthersHaveToBeThree) {
  EXPECT_FALSE(weak.confirms(found(0, 0, 0.55, 0.8)));
  EXPECT_FALSE(weak.confirms(found(0.2, 0.05, 0.65, 0.8)));
  EXPECT_TRUE(weak.confirms(found(0.4, 0.10, 0.55, 0.8)));
}

TEST_F(Row, TwoWhoseOddsAreEnoughTogetherAreEnough) {
  const auto with_odds = [](double seconds, double odds) {
    Detection out = found(seconds, 0, 0.45, 0.9);
    out.log_odds = odds;
    return out;
  };
  EXPECT_FALSE(weak.confirms(with_odds(0, 3))) << "one alone is not for it to believe";
  EXPECT_TRUE(weak.confirms(with_odds(0.2, 0.1)));
  EXPECT_FALSE(weak.confirms(with_odds(0.4, 0.3)));
  EXPECT_FALSE(weak.confirms(with_odds(0.6, 0.3)));
  EXPECT_TRUE(weak.confirms(with_odds(0.8, 0.3))) << "three are";
}

TEST_F(Row, SaysWhatGoesOn) {
  EXPECT_FALSE(weak.continued_by(found(0, 0, 0.65, 0.8)));
  EXPECT_FALSE(weak.confirms(found(0, 0, 0.65, 0.8)));
  EXPECT_TRUE(weak.continued_by(found(0.2, 0.1, 0.65, 0.8)));
  EXPECT_FALSE(weak.continued_by(found(0.2, 0.5, 0.65, 0.8)));
  EXPECT_FALSE(weak.continued_by(Detection()));
  EXPECT_TRUE(weak.confirms(found(0.2, 0.1, 0.65, 0.8))) << "asking changes nothing";
}

TEST_F(Row, WhatDoesNotCountIsOnlyLookedAtAgain) {
  for (int i = 0; i < 3; ++i) weak.keep(found(0.1 * i, 0, 0.65, 0.8));
  ASSERT_NE(weak.newest(), nullptr);
  EXPECT_EQ(to_seconds(weak.newest()->time - Time()), 0.2);
  EXPECT_FALSE(weak.confirms(found(0.4, 0, 0.65, 0.8))) << "the first that counts";
  weak.keep(found(0.5, 0.5, 0.65, 0.8));
  EXPECT_TRUE(weak.confirms(found(0.6, 0, 0.65, 0.8))) << "it has waited";
  weak.keep(Detection());
  EXPECT_EQ(weak.newest(), nullptr);
}

TEST_F(Row, AnotherPlaceStartsItAnew) {
  EXPECT_FALSE(weak.confirms(found(0, 0, 0.65, 0.8)));
  EXPECT_FALSE(weak.confirms(found(0.2, 0.5, 0.65, 0.8))) << "faster than 1 m/s";
  EXPECT_TRUE(weak.confirms(found(0.4, 0.5, 0.65, 0.8)));
}

TEST_F(Row, NothingFoundOrLongAgoStartsItAnew) {
  EXPECT_FALSE(weak.confirms(found(0, 0, 0.65, 0.8)));
  EXPECT_FALSE(weak.confirms(Detection()));
  EXPECT_FALSE(weak.confirms(found(0.4, 0, 0.65, 0.8)));
  EXPECT_FALSE(weak.confirms(found(2.4, 0, 0.65, 0.8)));
  EXPECT_TRUE(weak.confirms(found(2.6, 0, 0.65, 0.8)));
}

TEST_F(Row, ThreeHaveToMoveSteadily) {
  EXPECT_FALSE(weak.confirms(found(0, 0, 0.55, 0.8)));
  EXPECT_FALSE(weak.confirms(found(0.2, 0.15, 0.55, 0.8)));
  EXPECT_FALSE(weak.confirms(found(0.4, 0.05, 0.55, 0.8))) << "back again: clutter to and fro";
}

TEST_F(Row, ATurnThatNoObjectMakesStartsItAnew) {
  Detection turned = found(0.1, 0, 0.65, 0.8);
  turned.poses.front().world_from_object.rotation =
      Eigen::Quaterniond(Eigen::AngleAxisd(2.0, Eigen::Vector3d::UnitX()));
  EXPECT_FALSE(weak.confirms(found(0, 0, 0.65, 0.8)));
  EXPECT_FALSE(weak.confirms(turned));
}

}  // namespace
}  // namespace sightline::observe
