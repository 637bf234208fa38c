// SPDX-License-Identifier: Apache-2.0
// What checks make of a pose: whether it may be claimed, and when another one takes its place.
#include "sightline/pipeline/search/pose_proof.hpp"

#include <gtest/gtest.h>

#include "first_frames.hpp"

namespace sightline::test {
namespace {

struct Proof : testing::Test {
  static const ViewpointModel& views() {
    static const FirstFrames bench = first_frames_of_bench();
    return bench.model();
  }
  static OrientationComparison says(double here, double other, double turn = 1.0) {
    OrientationComparison out;
    out.here = here;
    out.other = other;
    const Eigen::Quaterniond rotation(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()));
    out.best.poses.push_back(
        {Rigid3(rotation, Eigen::Vector3d::Zero()), Vector6::Zero(), other, 2});
    return out;
  }
  bool check(const OrientationComparison& comparison) {
    proof.count();
    return proof.refuted_by(views(), Rigid3(), comparison);
  }
  static Detection found(double score) {
    Detection out;
    out.by_contour = true;
    out.poses.push_back({Rigid3(), Vector6::Zero(), score, 2});
    return out;
  }
  PoseProof proof;
};

TEST_F(Proof, OneCheckIsEnoughForWhatStoodOut) {
  proof.begin(found(0.8));
  EXPECT_FALSE(proof.proven());
  EXPECT_FALSE(check(says(0.7, 0.5)));
  EXPECT_TRUE(proof.proven());
}

TEST_F(Proof, TwoInARowForWhatStoodOutByLittle) {
  proof.begin(found(0.6));
  (void)check(says(0.7, 0.5));
  EXPECT_FALSE(proof.proven());
  (void)check(says(0.5, 0.52));
  (void)check(says(0.7, 0.5));
  EXPECT_FALSE(proof.proven()) << "not in a row";
  (void)check(says(0.7, 0.5));
  EXPECT_TRUE(proof.proven());
}

TEST_F(Proof, AnotherOrientationHasToShowTwice) {
  proof.begin(found(0.8));
  EXPECT_FALSE(check(says(0.5, 0.7, 1.0)));
  EXPECT_TRUE(proof.suspected());
  EXPECT_FALSE(check(says(0.7, 0.5)));
  EXPECT_FALSE(proof.suspected()) << "a check between them spoke for it";
  EXPECT_FALSE(check(says(0.6, 0.68, 1.0)));
  EXPECT_FALSE(check(says(0.6, 0.68, 1.6))) << "another one each time, neither clearly";
  EXPECT_TRUE(check(says(0.6, 0.75, 1.6)));
}

TEST_F(Proof, WhatChecksDoNotFindIsProvenAnew) {
  proof.begin(found(0.8));
  (void)check(says(0.7, 0.5));
  ASSERT_TRUE(proof.proven());
  (void)check(says(0.2, 0.1));
  EXPECT_FALSE(proof.take_doubts()) << "one alone: covered for a moment";
  (void)check(says(0.1, 0.1));
  EXPECT_TRUE(proof.take_doubts());
  EXPECT_FALSE(proof.take_doubts()) << "once";
  proof.begin_weakly();
  EXPECT_FALSE(proof.proven());
  (void)check(says(0.7, 0.5));
  EXPECT_FALSE(proof.proven());
  (void)check(says(0.7, 0.5));
  EXPECT_TRUE(proof.proven());
}

TEST_F(Proof, ChecksAreFrequentAtFirstAndAfterASuspicion) {
  using namespace std::chrono_literals;
  proof.begin(found(0.8));
  const Duration early = proof.pause(TrackState::kTracking);
  for (int i = 0; i < 4; ++i) (void)check(says(0.7, 0.5));
  EXPECT_GT(proof.pause(TrackState::kDegraded), early);
  EXPECT_GT(proof.pause(TrackState::kTracking), proof.pause(TrackState::kDegraded));
  (void)check(says(0.5, 0.7));
  EXPECT_LT(proof.pause(TrackState::kTracking), early);
}

}  // namespace
}  // namespace sightline::test
