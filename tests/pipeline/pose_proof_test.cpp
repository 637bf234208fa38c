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
    out.rank = out.fitted_rank = 0.6;
    const Eigen::Quaterniond rotation(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()));
    out.best.poses.push_back(
        {Rigid3(rotation, Eigen::Vector3d::Zero()), Vector6::Zero(), other, 2});
    return out;
  }
  bool check(const OrientationComparison& comparison) {
    proof.count();
    now += std::chrono::seconds(1);
    const bool refuted = proof.refuted_by(views(), Rigid3(), comparison);
    searched = !refuted && proof.wants_search(comparison, now);
    return refuted;
  }
  // A check of a pose of this rank, and a search about its place, if it asks for that.
  void search(double rank, bool same, double found_rank, double second = 0.5) {
    search_fitted(rank, rank, same, found_rank, second);
  }
  void search_fitted(double rank, double fitted_rank, bool same, double found_rank, double second) {
    OrientationComparison comparison = says(0.7, 0.5);
    comparison.rank = rank;
    comparison.fitted_rank = fitted_rank;
    (void)check(comparison);
    PlaceSearch about;
    about.same = same;
    about.rank = found_rank;
    about.second = second;
    if (searched) proof.note_search(about, comparison, now);
  }
  static Detection found(double score) {
    Detection out;
    out.by_contour = true;
    out.contour_score = score;
    out.poses.push_back({Rigid3(), Vector6::Zero(), score, 2});
    return out;
  }
  PoseProof proof;
  Time now{};
  bool searched = false;  ///< the last check has asked for it
};

TEST_F(Proof, OneCheckIsEnoughForWhatStoodOut) {
  proof.begin(found(0.8));
  EXPECT_FALSE(proof.proven());
  EXPECT_FALSE(check(says(0.7, 0.5)));
  EXPECT_TRUE(proof.proven());
}

// Edges and colors count otherwise than contours: by little does not stand out what both find.
TEST_F(Proof, WhatEdgesFindTooIsJudgedByItsContour) {
  Detection both = found(0.8);
  both.poses.front().evidence = 0.3;
  proof.begin(both);
  (void)check(says(0.7, 0.5));
  EXPECT_TRUE(proof.proven());
}

TEST_F(Proof, AsItWasFoundItIsProvenOnlyIfThatIsClear) {
  OrientationComparison low = says(0.7, 0.5);
  low.rank = 0.5;
  for (const OrientationComparison& compared : {low, says(0.7, 0.65)}) {
    proof.begin(found(0.8));
    EXPECT_FALSE(proof.shown_as_found(views(), Rigid3(), compared));
    EXPECT_TRUE(proof.unchecked());
    EXPECT_FALSE(proof.proven());
    const Duration soon = proof.pause(TrackState::kDegraded);
    EXPECT_FALSE(check(compared)) << "as it is tracked that is enough";
    EXPECT_TRUE(proof.proven());
    EXPECT_LT(soon, proof.pause(TrackState::kDegraded));
  }
  proof.begin(found(0.8));
  EXPECT_TRUE(proof.shown_as_found(views(), Rigid3(), says(0.7, 0.5)));
  EXPECT_FALSE(proof.unchecked());
  EXPECT_TRUE(proof.proven());
  proof.begin(found(0.6));
  EXPECT_TRUE(proof.shown_as_found(views(), Rigid3(), says(0.7, 0.5)));
  EXPECT_FALSE(proof.proven()) << "what stood out by little needs two";
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

TEST_F(Proof, WhatDoesNotStandOutHasToBeFoundAgain) {
  proof.begin(found(0.8));
  (void)check(says(0.7, 0.5));
  EXPECT_FALSE(searched) << "it stands out";
  proof.begin(found(0.8));
  search(0.2, true, 0.25);
  EXPECT_TRUE(searched);
  EXPECT_TRUE(proof.proven());
}

TEST_F(Proof, WhatIsFoundAgainAmongOthersAsGoodIsNoProof) {
  proof.begin(found(0.8));
  for (int i = 0; i < 10; ++i) search(0.2, true, 0.25, 0.95);
  EXPECT_FALSE(proof.proven());
  EXPECT_FALSE(proof.disbelieved()) << "nor does it speak against it";
  search(0.2, true, 0.25, 0.7);
  EXPECT_TRUE(proof.proven());
  for (int i = 0; i < 10; ++i) search(0.2, true, 0.25, 0.95);
  EXPECT_TRUE(proof.proven()) << "what one look has told holds";
}

TEST_F(Proof, WhatIsFoundAgainAmongOthersNearlyAsGoodIsHalfAProof) {
  proof.begin(found(0.8));
  search(0.2, true, 0.25, 0.8);
  EXPECT_FALSE(proof.proven());
  search(0.2, true, 0.25, 0.8);
  EXPECT_TRUE(proof.proven());
}

TEST_F(Proof, SomethingElseThatRanksMoreTakesTheClaimBack) {
  proof.begin(found(0.8));
  for (int i = 0; i < 2; ++i) search(0.2, true, 0.2);
  ASSERT_TRUE(proof.proven());
  search(0.2, false, 0.22);
  EXPECT_TRUE(proof.proven()) << "hardly more";
  search(0.2, false, 0.4);
  EXPECT_FALSE(proof.proven());
  EXPECT_FALSE(proof.disbelieved()) << "one alone";
  search(0.2, false, 0.4);
  EXPECT_TRUE(proof.disbelieved());
  search(0.2, false, 0.4);
  EXPECT_FALSE(searched) << "a search of everything takes its place";
  proof.note_found_again();
  EXPECT_FALSE(proof.disbelieved());
  EXPECT_FALSE(proof.proven());
  for (int i = 0; i < 2; ++i) search(0.2, true, 0.2);
  EXPECT_TRUE(proof.proven());
}

// "The same" is within 20 degrees.
TEST_F(Proof, ATrackThatFallsBehindWhatTurnsLosesItsClaim) {
  proof.begin(found(0.8));
  search(0.7, true, 0.7);
  ASSERT_TRUE(proof.proven());
  search_fitted(0.17, 0.6, true, 0.63, 0.86);
  EXPECT_TRUE(proof.proven()) << "predicted a little off: the fit from there comes to it";
  search_fitted(0.17, 0.37, true, 0.63, 0.86);
  EXPECT_FALSE(proof.proven());
}

TEST_F(Proof, ARankThatHasFallenAndSomethingElseThatRanksMoreTakeTheClaimBack) {
  for (const bool fell : {true, false}) {
    proof = PoseProof();
    proof.begin(found(0.8));
    search(fell ? 0.7 : 0.35, true, 0.4);
    ASSERT_TRUE(proof.proven());
    search_fitted(0.2, 0.32, false, 0.35, 0.95);
    EXPECT_TRUE(searched);
    EXPECT_EQ(proof.proven(), !fell);
  }
}

TEST_F(Proof, WhatNothingElseOutranksIsClaimedInTheEnd) {
  proof.begin(found(0.8));
  for (int i = 0; i < 2; ++i) search(0.2, false, 0.2);
  EXPECT_FALSE(proof.proven());
  for (int i = 0; i < 2; ++i) search(0.2, false, 0.2);
  EXPECT_TRUE(proof.proven());
}

TEST_F(Proof, WhatWasTakenForSomethingElseIsProvenByMore) {
  proof.begin(found(0.8));
  search(0.2, false, 0.4);
  ASSERT_TRUE(proof.disbelieved());
  proof.let_pass();
  EXPECT_TRUE(proof.disbelieved()) << "out of view it is no better";
  proof.begin(found(0.8));
  EXPECT_FALSE(proof.disbelieved());
  search(0.2, true, 0.2);
  EXPECT_FALSE(proof.proven());
  search(0.2, true, 0.2);
  EXPECT_TRUE(proof.proven());
}

TEST_F(Proof, ColorsThatDoNotShowTakeTheClaimBack) {
  proof.begin(found(0.8));
  OrientationComparison comparison = says(0.7, 0.5);
  (void)check(comparison);
  ASSERT_TRUE(proof.proven());
  comparison.shows_colors = false;
  for (int i = 0; i < 3; ++i) (void)check(comparison);
  EXPECT_TRUE(proof.proven()) << "a shadow, for a moment";
  for (int i = 0; i < 3; ++i) (void)check(comparison);
  EXPECT_FALSE(proof.proven());
  EXPECT_FALSE(proof.disbelieved()) << "colors may be wrong";
  comparison.shows_colors = true;
  for (int i = 0; i < 3; ++i) (void)check(comparison);
  EXPECT_TRUE(proof.proven());
}

TEST_F(Proof, ChecksAreFrequentAtFirstAndAfterASuspicion) {
  using namespace std::chrono_literals;
  proof.begin(found(0.8));
  const Duration first = proof.pause(TrackState::kTracking);
  (void)check(says(0.7, 0.5));
  const Duration early = proof.pause(TrackState::kTracking);
  EXPECT_LT(first, early);
  for (int i = 0; i < 3; ++i) (void)check(says(0.7, 0.5));
  EXPECT_GT(proof.pause(TrackState::kDegraded), early);
  EXPECT_GT(proof.pause(TrackState::kTracking), proof.pause(TrackState::kDegraded));
  (void)check(says(0.5, 0.7));
  EXPECT_LT(proof.pause(TrackState::kTracking), early);
}

}  // namespace
}  // namespace sightline::test
