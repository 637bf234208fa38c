// SPDX-License-Identifier: Apache-2.0
// Images that show more of an object than its pose explains, or nothing where it has to be.
#include <gtest/gtest.h>

#include "fuse/rig_run.hpp"

namespace sightline {
namespace {

using namespace fuse_test;

// Every camera looks at the whole silhouette in each of its frames; from the tenth set on camera k
// says `later[k]`, nothing where there is none.
std::vector<PoseEstimate> run_with(const std::vector<PictureAgreement>& later, bool seen) {
  const int cameras = static_cast<int>(later.size());
  const SyntheticRig rig(moving_rig(cameras));
  auto estimator = make();
  std::vector<PoseEstimate> out;
  int n = 0;
  for (const auto& each : rig.sets()) {
    std::vector<Observation> set(each.begin(), each.end());
    for (Observation& observation : set) {
      const PictureAgreement& picture = later.at(observation.camera.index());
      observation.picture = n < 10 ? PictureAgreement{} : picture;
      if (n < 10 || seen || picture.missing < 1) continue;
      observation.terms.clear();
      observation.hypotheses.clear();
    }
    out.push_back(estimator.process(set).estimate);
    ++n;
  }
  return out;
}

int unexplained(const std::vector<PoseEstimate>& estimates, size_t from) {
  int count = 0;
  for (size_t i = from; i < estimates.size(); ++i) {
    count += (estimates[i].degraded_reasons & kUnexplained) != 0 ? 1 : 0;
  }
  return count;
}

TEST(Pictures, ThatShowMoreOfItInAllCamerasAreDegradedByName) {
  const auto estimates = run_with({{0.4f, 0}, {0.3f, 0.1f}}, true);
  ASSERT_GT(estimates.size(), 24u);
  EXPECT_EQ(unexplained(estimates, 0), unexplained(estimates, 10));
  EXPECT_EQ(unexplained(estimates, 14), static_cast<int>(estimates.size()) - 14);
  EXPECT_EQ(estimates.back().state, TrackState::kDegraded);
  EXPECT_EQ(to_string(estimates.back().degraded_reasons, ","), "unexplained");
}

TEST(Pictures, OneCameraBesideWhichSomethingLiesIsOutvoted) {
  EXPECT_EQ(unexplained(run_with({{0.3f, 0}, {0, 0}, {0.02f, 0}}, true), 0), 0);
}

TEST(Pictures, OneOfTwoThatSeesNothingMayBeCovered) {
  EXPECT_EQ(unexplained(run_with({{0, 1}, {0, 0}}, false), 0), 0);
}

// The other one misses it once, long after the first was covered.
TEST(Pictures, OneMissedFrameOfTheOtherIsForgotten) {
  const SyntheticRig rig(moving_rig(2));
  auto estimator = make();
  std::vector<PoseEstimate> out;
  for (const auto& each : rig.sets()) {
    std::vector<Observation> set(each.begin(), each.end());
    for (Observation& observation : set) {
      const bool first = observation.camera.index() == 0;
      if (out.size() < 10 || (!first && out.size() != 20)) continue;
      observation.picture = PictureAgreement{0, 1};
      observation.terms.clear();
      observation.hypotheses.clear();
    }
    out.push_back(estimator.process(set).estimate);
  }
  ASSERT_GT(out.size(), 28u);
  EXPECT_EQ(unexplained(out, out.size() - 2), 0);
}

TEST(Pictures, MoreCamerasThatSeeNothingThanSeeItSpeakAgainstIt) {
  const auto estimates = run_with({{0, 1}, {0, 1}, {0, 0}}, false);
  EXPECT_GT(unexplained(estimates, 0), static_cast<int>(estimates.size()) / 2);
  EXPECT_NE(estimates.back().state, TrackState::kTracking);
}

// What each of two cameras shows of the object's print, frame by frame; kNone: nothing at all.
struct Prints {
  PrintSeen first = PrintSeen::kNone, second = PrintSeen::kNone;
};

std::vector<PoseEstimate> run_with(const std::vector<Prints>& prints,
                                   const EstimatorOptions& options = {}) {
  RigOptions moving = moving_rig(2);
  moving.phases = {0, 0};
  const SyntheticRig rig(moving);
  auto estimator = make(options);
  std::vector<PoseEstimate> out;
  for (const Prints& print : prints) {
    const auto seen = rig.sets()[out.size()];
    std::vector<Observation> set(seen.begin(), seen.end());
    for (Observation& observation : set) {
      observation.print = observation.camera.index() == 0 ? print.first : print.second;
      if (observation.print != PrintSeen::kNone) continue;
      observation.terms.clear();
      observation.hypotheses.clear();
    }
    out.push_back(estimator.process(set).estimate);
  }
  return out;
}

std::vector<Prints> times(size_t count, const Prints& prints) { return {count, prints}; }

std::vector<Prints> operator+(std::vector<Prints> a, const std::vector<Prints>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

constexpr Prints kOneFlat{PrintSeen::kFlat, PrintSeen::kNone};

TEST(FlatPrints, OfOneCameraAreDegradedByName) {
  const auto estimates = run_with(times(12, kOneFlat));
  for (const PoseEstimate& estimate : estimates) {
    EXPECT_EQ(estimate.state, TrackState::kDegraded);
    EXPECT_TRUE(estimate.degraded_reasons & kFlatPrint);
  }
  EXPECT_EQ(to_string(estimates.back().degraded_reasons, ","), "flat_print");
  EstimatorOptions trusting;
  trusting.flat_print_is_degraded = false;
  EXPECT_EQ(run_with(times(12, kOneFlat), trusting).back().state, TrackState::kTracking);
}

TEST(FlatPrints, ThatHaveMovedOrShowAnotherSideAreTheObject) {
  const auto estimates =
      run_with(times(6, kOneFlat) + times(1, {PrintSeen::kSolid}) + times(6, kOneFlat));
  EXPECT_EQ(estimates[5].state, TrackState::kDegraded);
  for (size_t i = 6; i < 13; ++i) EXPECT_EQ(estimates[i].state, TrackState::kTracking) << i;
}

TEST(FlatPrints, WhatTwoCamerasHaveTrackedIsTheObject) {
  const auto estimates =
      run_with(times(4, {PrintSeen::kFlat, PrintSeen::kFlat}) + times(9, kOneFlat));
  for (const PoseEstimate& estimate : estimates) {
    EXPECT_EQ(estimate.degraded_reasons & kFlatPrint, 0);
  }
  EXPECT_EQ(estimates.back().state, TrackState::kTracking);
}

}  // namespace
}  // namespace sightline
