// SPDX-License-Identifier: Apache-2.0
// What a search believes of a best pose that others at its place come near to, and do not.
#include "observe/detect/judge/contour_belief.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "made_poses.hpp"
#include "observe/detect/detect_constants.hpp"
#include "observe/detect/judge/second_to_best.hpp"
#include "support/scene_rig.hpp"
#include "support/scene_shapes.hpp"
#include "support/search_scene.hpp"

namespace sightline::observe {
namespace {

using test::turned;
using Where = DetectorFrames::Where;

constexpr ObjectId kObject(3);

ContourPose pose_of(const Rigid3& pose, double score, size_t cameras = 3) {
  return made_contour(pose, std::vector<double>(cameras, score));
}

// A creature before three cameras: what is said to be found there is made up.
class Belief : public testing::Test {
 protected:
  static void SetUpTestSuite() { views_ = test::views_of(test::make_creature(2000)); }
  static void TearDownTestSuite() { views_.reset(); }

  Belief()
      : rig_(test::search_scene(test::make_creature(2000), test::resting(here))),
        frames_(test::detector_cameras(rig_), {}),
        judge_(kObject, {}, views_->center(), views_->radius()),
        belief_(*views_, judge_) {
    test::add_first_frames(
        rig_, [&](CameraId id, const Frame& frame) { frames_.add(id, frame, nullptr); });
    EXPECT_TRUE(frames_.select(Where::kEverywhere));
  }

  Detection believe(double score, double share_of_another) {
    const std::vector<ContourPose> poses = {pose_of(here, score), pose_of(here, 0.99 * score),
                                            pose_of(turned_here, share_of_another * score)};
    time_ += std::chrono::milliseconds(200);
    return belief_.believe(frames_, poses, Where::kEverywhere, time_, nullptr,
                           [](const Detection&) { return false; });
  }

  // So many lines agree, at a score of 0.45; another place has so much of that.
  Detection believe_faint(double edge_share, double rival) {
    ContourPose best = made_contour(here, std::vector<double>(3, 0.45));
    best.fit = made_fit(here, std::vector<double>(3, edge_share));
    time_ += std::chrono::milliseconds(200);
    return belief_.believe(frames_, {best, pose_of(elsewhere, rival * 0.45)}, Where::kEverywhere,
                           time_, nullptr, [](const Detection&) { return false; });
  }

  static std::shared_ptr<const ViewpointModel> views_;
  const Rigid3 here = turned(0.8, {1, 2, 3}, {0.03, -0.02, 0.01});
  const Rigid3 turned_here = here * turned(0.3, {0, 0, 1}, {0, 0, 0});
  const Rigid3 elsewhere = Rigid3(Eigen::Quaterniond::Identity(), {0.5, 0, 0}) * here;
  test::SceneRig rig_;
  DetectorFrames frames_;
  DetectionJudge judge_;
  ContourBelief belief_;
  Time time_{std::chrono::seconds(1)};
};

std::shared_ptr<const ViewpointModel> Belief::views_;

TEST_F(Belief, SecondIsTheBestOfThoseThatDiffer) {
  const auto moved = [&](double share) {
    return Rigid3(Eigen::Quaterniond::Identity(), {share * views_->radius(), 0, 0}) * here;
  };
  const auto second = [&](const std::vector<ContourPose>& poses) {
    return second_to_best(*views_, poses);
  };
  EXPECT_EQ(second({pose_of(here, 0.8)}), 0);
  EXPECT_EQ(second({pose_of(here, 0.8), pose_of(here, 0.8), pose_of(moved(0.1), 0.8)}), 0)
      << "fits of one pose";
  EXPECT_NEAR(second({pose_of(here, 0.8), pose_of(turned_here, 0.4)}), 0.5, 1e-9);
  EXPECT_NEAR(second({pose_of(here, 0.8), pose_of(moved(0.3), 0.6)}), 0.75, 1e-9);
  EXPECT_NEAR(second({pose_of(here, 0.8), pose_of(moved(0.3), 0.6), pose_of(turned_here, 0.7)}),
              0.875, 1e-9)
      << "in any order";
  EXPECT_EQ(second({pose_of(here, 0.8), pose_of(moved(1.5), 0.8)}), 0) << "at another place";
  EXPECT_EQ(second({pose_of(here, 0)}), 1) << "nothing";
}

TEST_F(Belief, OnePoseThatNoOtherComesNearToIsBelievedAtOnce) {
  ASSERT_TRUE(views_->near_rotations().empty());
  EXPECT_TRUE(believe(0.58, 0.6).poses.empty());
  EXPECT_EQ(believe(0.62, 0.6).poses.size(), 1u);
}

TEST_F(Belief, TurnsThatTheShapeHardlyTellsAreNoOtherPose) {
  const auto views =
      test::views_of(test::make_column_with_box({0.036f, 0, 0}, {0.014f, 0.006f, 0.05f}));
  ASSERT_FALSE(views->near_rotations().empty());
  const Rigid3 near = here * views->near_rotations().front();
  const std::vector<ContourPose> poses = {pose_of(here, 0.8), pose_of(near, 0.76),
                                          pose_of(here * turned(0.5, {1, 0, 0}, {0, 0, 0}), 0.4)};
  EXPECT_NEAR(second_to_best(*views, poses), 0.76 * 0.76 / (0.8 * 0.8), 0.1);
  EXPECT_NEAR(second_to_best(*views, poses, NearTurns::kSame), 0.5, 0.15);
}

// An object that hardly differs in color from what is behind it: lines agree, contours score low.
TEST_F(Belief, WhatHardlyStandsOutIsBelievedByItsOdds) {
  EXPECT_FALSE(believe_faint(0.75, 0).poses.empty()) << "beyond doubt";
  EXPECT_TRUE(believe_faint(0.72, 0.88).poses.empty());
  EXPECT_FALSE(believe_faint(0.72, 0.88).poses.empty()) << "found again";
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(believe_faint(0.5, 0).poses.empty()) << "too few lines";
}

TEST_F(Belief, OddsAreThoseOfSeveralCameras) {
  const auto odds = [&](const std::vector<double>& cameras) {
    const std::vector<ContourPose> poses = {made_contour(here, cameras)};
    return ContourBelief::odds_of(poses, belief_.evidence_of(poses, time_, nullptr));
  };
  EXPECT_GT(odds({0.8, 0.8, 0.8}), 3);
  EXPECT_LT(odds({0.4, 0.4, 0.4}), 0);
  EXPECT_EQ(odds({0.9}), 0);
  EXPECT_EQ(odds({0.9, 0.1, -1}), 0) << "one shows it";
}

TEST_F(Belief, EvidenceIsOfTheCamerasThatHaveIt) {
  const std::vector<ContourPose> poses = {made_contour(here, {0.8, 0.6, -1}),
                                          made_contour(elsewhere, {0.35, 0.35, 0.35})};
  const SearchEvidence evidence = belief_.evidence_of(poses, time_, nullptr);
  EXPECT_NEAR(evidence.edge_share, 0.7, 1e-9);
  EXPECT_NEAR(evidence.score, 0.7, 1e-9);
  EXPECT_NEAR(evidence.rival_share, 0.35 / 0.7, 1e-9);
  EXPECT_EQ(evidence.second_share, 0);
  EXPECT_EQ(evidence.colors, 0);
  EXPECT_NEAR(belief_.evidence_of(poses, time_, nullptr, 0.63).rival_share, 0.9, 1e-9)
      << "known before";
}

TEST_F(Belief, AmongEqualsNothingIsBelievedHoweverOften) {
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(believe(0.9, 0.95).poses.empty());
  EXPECT_TRUE(believe(0.55, 0.8).poses.empty()) << "the first that counts";
  EXPECT_TRUE(believe(0.9, 0.95).poses.empty());
  EXPECT_FALSE(believe(0.55, 0.8).poses.empty()) << "it went on waiting";
}

TEST_F(Belief, EdgesAreContradictedAmongEquals) {
  Detection by_edges;
  by_edges.time = time_;
  by_edges.poses.push_back({here, Vector6::Zero()});
  const auto contradicts = [&](double share, size_t cameras) {
    return belief_.contradicts(
        by_edges, frames_,
        {pose_of(here, 0.8, cameras), pose_of(turned_here, share * 0.8, cameras)}, nullptr);
  };
  EXPECT_TRUE(contradicts(0.95, 3));
  EXPECT_FALSE(contradicts(0.85, 3));
  EXPECT_FALSE(contradicts(0.95, 1)) << "one camera's orientations are hardly told apart";
}

}  // namespace
}  // namespace sightline::observe
