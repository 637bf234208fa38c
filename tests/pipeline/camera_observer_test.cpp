// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/camera_observer.hpp"

#include <gmock/gmock.h>

#include <numbers>

namespace sightline {
namespace {

Rigid3 half_turn(const Eigen::Vector3d& axis) {
  return Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi, axis)), {0, 0, 0});
}
const Rigid3 kAboutX = half_turn(Eigen::Vector3d::UnitX());
const Rigid3 kAboutY = half_turn(Eigen::Vector3d::UnitY());
const Rigid3 kAboutZ = half_turn(Eigen::Vector3d::UnitZ());

Observation observation_of(uint32_t object, std::vector<PoseHypothesis> symmetric) {
  Observation observation;
  observation.object = ObjectId(object);
  observation.symmetric_hypotheses = std::move(symmetric);
  return observation;
}

std::vector<double> costs_of(const Observation& observation) {
  std::vector<double> costs;
  for (const PoseHypothesis& h : observation.symmetric_hypotheses) costs.push_back(h.cost);
  return costs;
}

TEST(MergeObservations, EvidenceOfOneModalityIsKept) {
  const std::vector<PoseHypothesis> colors = {{Rigid3(), 1}, {kAboutZ, 4}};
  for (const bool first : {true, false}) {
    std::vector<Observation> all = {observation_of(0, {}), observation_of(1, {}),
                                    observation_of(0, {})};
    all[first ? 0 : 2].symmetric_hypotheses = colors;
    merge_observations(0, all);
    ASSERT_EQ(all.size(), 2u);
    EXPECT_THAT(costs_of(all[0]), testing::ElementsAre(1, 4));
    EXPECT_TRUE(all[1].symmetric_hypotheses.empty());
  }
}

TEST(MergeObservations, MarkersThatAreSeenOutweighAnOutlineThatIsNot) {
  for (const bool first : {true, false}) {
    std::vector<Observation> all = {observation_of(0, {}), observation_of(0, {})};
    Observation& by_markers = all[first ? 0 : 1];
    by_markers.terms.push_back(std::make_shared<const FrozenTerm>(Rigid3(), LinearizedTerm()));
    all[first ? 1 : 0].picture = PictureAgreement{0, 1};
    merge_observations(0, all);
    ASSERT_EQ(all.size(), 1u);
    EXPECT_EQ(all[0].terms.size(), 1u);
    EXPECT_FALSE(all[0].picture);
  }
}

TEST(MergeObservations, CostsOfCorrespondingPosesAddUp) {
  // The modalities name the same poses, in another order and not quite where the other has them.
  Vector6 off;
  off << 0.05, -0.03, 0.04, 0.002, 0.001, -0.003;
  const Rigid3 near = Rigid3::exp(off);
  std::vector<Observation> all = {
      observation_of(0, {{Rigid3(), 1}, {kAboutX, 2}, {kAboutY, 3}}),
      observation_of(0, {{kAboutY * near, 30}, {near, 10}, {kAboutX * near, 20}})};
  merge_observations(0, all);
  ASSERT_EQ(all.size(), 1u);
  EXPECT_THAT(costs_of(all[0]), testing::ElementsAre(11, 22, 33));
  EXPECT_LT(rotation_angle(all[0].symmetric_hypotheses[2].world_from_object, kAboutY), 1e-9);
}

TEST(MergeObservations, APoseThatOneDoesNotNameIsItsLeastLikely) {
  std::vector<Observation> all = {observation_of(0, {{Rigid3(), 1}, {kAboutX, 2}}),
                                  observation_of(0, {{Rigid3(), 10}, {kAboutY, 30}})};
  merge_observations(0, all);
  EXPECT_THAT(costs_of(all[0]), testing::ElementsAre(1 + 10, 2 + 30, 2 + 30));
}

TEST(MergeObservations, LeavesWhatIsBeforeTheFirst) {
  std::vector<Observation> all = {observation_of(0, {{Rigid3(), 1}}), observation_of(0, {})};
  merge_observations(1, all);
  EXPECT_EQ(all.size(), 2u);
}

}  // namespace
}  // namespace sightline
