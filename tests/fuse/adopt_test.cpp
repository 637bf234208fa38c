// SPDX-License-Identifier: Apache-2.0
// An estimator that goes on with what another one knew.
#include <gtest/gtest.h>

#include "fuse/rig_run.hpp"

namespace sightline {
namespace {

using namespace fuse_test;
using Set = std::vector<Observation>;

/// What can only refine a pose that is known, of one camera.
std::vector<Set> refinements(const SyntheticRig& rig, CameraId camera) {
  std::vector<Set> sets;
  for (const auto& set : rig.sets()) {
    Set kept;
    for (const Observation& observation : set) {
      if (observation.camera != camera) continue;
      kept.push_back(observation);
      kept.back().hypotheses.clear();
    }
    if (!kept.empty()) sets.push_back(std::move(kept));
  }
  return sets;
}

TEST(Adopt, GoesOnWhereTheOtherOneEnded) {
  int inside = 0, all = 0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const SyntheticRig rig(moving_rig(2, seed));
    auto first = make();
    auto second = make();
    const auto sets = rig.sets();
    const size_t half = sets.size() / 2;
    for (size_t i = 0; i < half; ++i) first.process(sets[i]);
    const Time end = first.track()->newest().time;
    ASSERT_TRUE(second.adopt(*first.track()));
    EXPECT_EQ(second.track()->newest().time, end);
    EXPECT_LT(translation_distance(second.track()->at(end).estimate.world_from_object,
                                   first.track()->at(end).estimate.world_from_object),
              1e-12);
    for (const Set& set : refinements(rig, CameraId(0))) {
      const UpdateReport report = second.process(set);
      if (set.front().capture <= end) {
        EXPECT_TRUE(report.dropped) << "it is in the estimate already";
        continue;
      }
      ASSERT_TRUE(has_pose(report.estimate.state));
      const Vector6 off =
          difference(report.estimate.world_from_object, rig.truth(report.estimate.time));
      ++all;
      // 99 % of chi-square with 6 degrees of freedom
      inside += off.dot(report.estimate.pose_covariance().ldlt().solve(off)) < 16.8 ? 1 : 0;
    }
    EXPECT_EQ(second.counters().starts, 0U);
    EXPECT_EQ(second.counters().resets, 0U);
  }
  EXPECT_GT(static_cast<double>(inside) / all, 0.95);
}

TEST(Adopt, RefinementsAloneStartNothing) {
  const SyntheticRig rig(moving_rig(2));
  auto estimator = make();
  for (const Set& set : refinements(rig, CameraId(0))) {
    EXPECT_FALSE(has_pose(estimator.process(set).estimate.state));
  }
}

TEST(Adopt, WithoutAPoseThereIsNothingToTake) {
  auto estimator = make(), other = make();
  EXPECT_FALSE(estimator.adopt(*other.track()));
  const SyntheticRig rig(moving_rig(2));
  (void)run(rig, other);
  other.advance(other.track()->newest().time + std::chrono::seconds(3));
  EXPECT_FALSE(estimator.adopt(*other.track()));
  EXPECT_TRUE(estimator.track()->empty());
}

TEST(Adopt, WhatNobodySeesAnyMoreIsLostAsElsewhere) {
  const SyntheticRig rig(moving_rig(2));
  auto other = make(), estimator = make();
  (void)run(rig, other);
  ASSERT_TRUE(estimator.adopt(*other.track()));
  const Time end = other.track()->newest().time;
  estimator.advance(end + std::chrono::milliseconds(300));
  EXPECT_EQ(estimator.state(), TrackState::kCoasting);
  estimator.advance(end + std::chrono::milliseconds(900));
  EXPECT_EQ(estimator.state(), TrackState::kLost);
  EXPECT_EQ(estimator.track()->newest().state, TrackState::kLost);
  EXPECT_EQ(estimator.track()->at(end + std::chrono::milliseconds(800)).source, PoseSource::kNone);
}

}  // namespace
}  // namespace sightline
