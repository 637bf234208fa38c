// SPDX-License-Identifier: Apache-2.0
// An outline that one camera alone sees has to tell the rotation better than anything else.
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

// The last estimate of so many cameras that measure with terms of this kind, with a limit of one
// camera's outline that nothing meets.
PoseEstimate last_of(int cameras, std::string_view kind) {
  EstimatorOptions options;
  options.max_sigma_rotation_alone = 1e-6;
  auto estimator = make(options);
  PoseEstimate last;
  const SyntheticRig rig(moving_rig(cameras));
  for (const auto& each : rig.sets()) {
    std::vector<Observation> set(each.begin(), each.end());
    for (Observation& observation : set) {
      for (PoseTermPtr& term : observation.terms) {
        term = std::make_shared<const NamedTerm>(term, kind);
      }
    }
    last = estimator.process(set).estimate;
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

}  // namespace
}  // namespace sightline
