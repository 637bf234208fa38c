// SPDX-License-Identifier: Apache-2.0
// What outlines alone have to show before they are believed: of one camera, the rotation better
// than anything else; of any, for a while.
#include <gtest/gtest.h>

#include "fuse/rig_run.hpp"

namespace sightline {
namespace {

using namespace fuse_test;

// The same measurement under another name.
class NamedTerm : public PoseTerm {
 public:
  NamedTerm(PoseTermPtr term, std::string_view kind) : term_(std::move(term)), kind_(kind) {}
  LinearizedTerm linearize(const Rigid3& pose) const override { return term_->linearize(pose); }
  std::string_view kind() const override { return kind_; }

 private:
  PoseTermPtr term_;
  std::string_view kind_;
};

std::vector<Observation> named(std::span<const Observation> from, std::string_view kind) {
  std::vector<Observation> set(from.begin(), from.end());
  for (Observation& observation : set) {
    for (PoseTermPtr& term : observation.terms) {
      term = std::make_shared<const NamedTerm>(term, kind);
    }
  }
  return set;
}

// The last estimate of so many cameras that measure with terms of this kind, with a limit of one
// camera's outline that nothing meets.
PoseEstimate last_of(int cameras, std::string_view kind) {
  EstimatorOptions options;
  options.max_sigma_rotation_alone = 1e-6;
  auto estimator = make(options);
  PoseEstimate last;
  const SyntheticRig rig(moving_rig(cameras));
  for (const auto& each : rig.sets()) {
    last = estimator.process(named(each, kind)).estimate;
  }
  return last;
}

TEST(Alone, AnOutlineThatDoesNotTellItsRotationIsDegraded) {
  const PoseEstimate outline = last_of(1, "region");
  EXPECT_EQ(outline.state, TrackState::kDegraded);
  EXPECT_EQ(to_string(outline.degraded_reasons, ","), "weak_rotation");
  EXPECT_EQ(last_of(1, "sparse_texture").state, TrackState::kDegraded) << "few points of one side";
}

TEST(Alone, OtherMeasurementsAndMoreCamerasHaveTheUsualLimit) {
  EXPECT_EQ(last_of(1, "fiducial").state, TrackState::kTracking);
  EXPECT_EQ(last_of(2, "region").state, TrackState::kTracking);
}

// What one camera's outlines err by is in the sigma that is published, not in what is judged.
TEST(Alone, AnOutlineIsNoSurerThanItsFrames) {
  const PoseEstimate outline = last_of(1, "region"), marker = last_of(1, "fiducial");
  EXPECT_GT(outline.sigma_translation(), 1.1 * marker.sigma_translation());
  EXPECT_NEAR(outline.own_sigma_translation(), marker.own_sigma_translation(),
              0.05 * marker.own_sigma_translation());
}

// From the end of a doubt that lasted while terms of this kind were measured, outlines from then
// on.
Duration until_tracking(std::string_view kind_while_doubted) {
  constexpr size_t kDoubted = 12;
  auto estimator = make();
  const SyntheticRig rig(moving_rig(2));
  std::optional<Time> end;
  for (size_t i = 0; i < rig.sets().size(); ++i) {
    const bool doubted = i < kDoubted;
    estimator.set_doubted(doubted);
    const PoseEstimate estimate =
        estimator.process(named(rig.sets()[i], doubted ? kind_while_doubted : "region")).estimate;
    if (doubted) {
      EXPECT_EQ(estimate.state, TrackState::kDegraded);
      continue;
    }
    if (!end) end = estimate.time;
    if (estimate.state == TrackState::kTracking) return estimate.time - *end;
  }
  return Duration::max();
}

TEST(Settled, ADoubtFromOutsideDoesNotHoldItBack) {
  EXPECT_EQ(until_tracking("region"), Duration(0));
}

TEST(Settled, WhatWasOnlyFoundHasToBeTracked) {
  EXPECT_GE(until_tracking("detection"), std::chrono::milliseconds(60));
  EXPECT_LE(until_tracking("detection"), std::chrono::milliseconds(200));
}

}  // namespace
}  // namespace sightline
