// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/detect/detection_policy.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>
#include <utility>
#include <vector>

namespace sightline {
namespace {

constexpr double kAccept = 0.4;

// A box: half a turn about z leaves its shape as it is.
ShapeSymmetry half_turn() {
  ShapeSymmetry out;
  out.rotations.push_back(
      Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitZ())),
             Eigen::Vector3d::Zero()));
  return out;
}

// One pose that one camera measured.
Detection detection(double evidence) {
  LinearizedTerm at;
  at.information = 1e4 * Matrix6::Identity();
  at.residuals = 40;
  at.cost = 3;
  Observation observation;
  observation.terms.push_back(std::make_shared<const FrozenTerm>(Rigid3(), at));
  observation.hypotheses.push_back({Rigid3(), at.cost});
  Detection out;
  out.poses.push_back({Rigid3(), Vector6::Zero(), evidence, 1});
  out.observations.push_back(std::move(observation));
  return out;
}

TEST(DetectionPolicy, AsksForMoreWhereNoColorsAgree) {
  const DetectionPolicy policy({}, kAccept, false);
  EXPECT_TRUE(policy.by_outline(detection(1.3 * kAccept), nullptr).poses.empty());
  EXPECT_EQ(policy.by_outline(detection(1.4 * kAccept), nullptr).poses.size(), 1u);
  EXPECT_TRUE(policy.by_outline({}, nullptr).poses.empty());
}

TEST(DetectionPolicy, LetsTheDetectorAskForLessWhereThereAreColors) {
  DetectorOptions options;
  options.accept = kAccept;
  EXPECT_EQ(DetectionPolicy::detector_options(options, false).accept, kAccept);
  EXPECT_EQ(DetectionPolicy::detector_options(options, true).accept, 0.75 * kAccept);
}

// Fine print does not look like itself at half size; so many matches are it all the same.
TEST(DetectionPolicy, MatchesConfirmWhatDoesNotLookLikeItsPrintAsAWhole) {
  const auto colors =
      ColorVerifier::create(std::vector<SurfaceSample>(100), {}).value();  // it has seen nothing
  PoseProposals proposals;
  proposals.poses.resize(2);
  proposals.poses[0].matches = 24;
  proposals.poses[1].matches = 23;
  const auto confirmed = [&](bool printed) {
    const auto out = DetectionPolicy({}, kAccept, printed).confirm(proposals, colors.get());
    return std::pair(out.poses[0].confirmed, out.poses[1].confirmed);
  };
  EXPECT_EQ(confirmed(true), std::pair(true, false));
  EXPECT_EQ(confirmed(false), std::pair(false, false)) << "colors are no print";
}

TEST(DetectionPolicy, FeaturesTellSymmetricPosesApart) {
  const DetectionPolicy policy(half_turn(), kAccept, false);
  const Detection found = policy.by_features(detection(0.1), nullptr);
  ASSERT_EQ(found.poses.size(), 1u) << "features are believed as they are";
  const std::vector<PoseHypothesis>& compared = found.observations[0].symmetric_hypotheses;
  ASSERT_EQ(compared.size(), 2u);
  EXPECT_EQ(compared[0].cost, 0);
  EXPECT_EQ(compared[1].cost, 0.5 * 40 / 2) << "at most so much a match";
  EXPECT_TRUE(policy.by_outline(detection(1), nullptr).observations[0].symmetric_hypotheses.empty())
      << "an outline knows nothing of them";
}

TEST(DetectionPolicy, ComparesNothingWhileSeveralPosesAreLeft) {
  const DetectionPolicy policy(half_turn(), kAccept, false);
  Detection two = detection(1);
  two.poses.push_back(two.poses.front());
  EXPECT_TRUE(
      policy.by_features(std::move(two), nullptr).observations[0].symmetric_hypotheses.empty());
}

}  // namespace
}  // namespace sightline
