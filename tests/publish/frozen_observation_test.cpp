// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/cell/frozen_observation.hpp"

#include <gtest/gtest.h>

namespace sightline {
namespace {

using namespace std::chrono_literals;

Matrix6 some_information() {
  Matrix6 a;
  for (int i = 0; i < 36; ++i) a(i / 6, i % 6) = std::sin(1.7 * i);
  return 1e6 * (a * a.transpose() + Matrix6::Identity());
}

/// Half a squared distance to a pose: curved over large turns, as images are.
class PullTo : public PoseTerm {
 public:
  PullTo(const Rigid3& target, std::string_view kind) : target_(target), kind_(kind) {}
  LinearizedTerm linearize(const Rigid3& pose) const override {
    const Vector6 x = difference(target_, pose);
    const Matrix6 jacobian = right_jacobian_inverse(x);
    LinearizedTerm term;
    term.information = jacobian.transpose() * information_ * jacobian;
    term.gradient = jacobian.transpose() * information_ * x;
    term.cost = 0.5 * x.dot(information_ * x);
    term.residuals = 20;
    term.quality = 0.8;
    return term;
  }
  std::string_view kind() const override { return kind_; }

 private:
  Rigid3 target_;
  std::string_view kind_;
  Matrix6 information_ = some_information();
};

Rigid3 moved(const Rigid3& pose, double rotation, double translation) {
  Vector6 d;
  d << rotation, -0.5 * rotation, 0.2 * rotation, translation, 0, -translation;
  return pose * Rigid3::exp(d);
}

const Rigid3 kTrue(Eigen::Quaterniond(0.8, 0.3, -0.4, 0.2), {0.1, -0.2, 1.5});

std::shared_ptr<PoseTrack> track_at(const Rigid3& pose) {
  PoseEstimate estimate;
  estimate.time = estimate.last_measured = time_from_ns(1'000'000'000);
  estimate.state = TrackState::kTracking;
  estimate.world_from_object = pose;
  estimate.covariance.setIdentity();
  estimate.covariance *= 1e-4;
  return std::make_shared<PoseTrack>(ObjectId(0), std::vector{estimate}, MotionNoise{});
}

Observation observation() {
  Observation o;
  o.capture = time_from_ns(1'010'000'000);
  o.capture_error = 1ms;
  o.terms = {std::make_shared<PullTo>(kTrue, "region"),
             std::make_shared<PullTo>(kTrue, "fiducial")};
  return o;
}

TEST(FrozenObservation, LinearizesWhereTheCameraEndsUp) {
  const auto frozen = freeze(observation(), track_at(moved(kTrue, 0.05, 0.01)).get());
  ASSERT_TRUE(frozen);
  ASSERT_EQ(frozen->at.size(), 1U);
  EXPECT_LT(rotation_angle(frozen->at[0].reference, kTrue), 0.005);
  EXPECT_LT(translation_distance(frozen->at[0].reference, kTrue), 0.001);
}

TEST(FrozenObservation, SaysTheSameNearThePose) {
  const Observation o = observation();
  const Observation again = thaw(*freeze(o, track_at(moved(kTrue, 0.05, 0.01)).get()), ObjectId(3),
                                 CameraId(7), o.capture);
  EXPECT_EQ(again.object, ObjectId(3));
  EXPECT_EQ(again.camera, CameraId(7));
  ASSERT_EQ(again.terms.size(), 2U);  // what sees the shape alone stays apart
  const Rigid3 pose = moved(kTrue, 0.01, 0.003);
  LinearizedTerm before, after;
  for (const auto& [terms, sum] : {std::pair(&o.terms, &before), std::pair(&again.terms, &after)}) {
    for (const PoseTermPtr& term : *terms) {
      const LinearizedTerm part = term->linearize(pose);
      sum->information += part.information;
      sum->gradient += part.gradient;
      sum->cost += part.cost;
      sum->residuals += part.residuals;
    }
  }
  EXPECT_EQ(after.residuals, before.residuals);
  EXPECT_LT((after.gradient - before.gradient).norm(), 0.01 * before.gradient.norm());
  EXPECT_LT((after.information - before.information).norm(), 0.01 * before.information.norm());
  EXPECT_NEAR(after.cost, before.cost, 0.01 * before.cost);
}

TEST(FrozenObservation, EachProposedPoseHasItsOwnNumbers) {
  Observation o = observation();
  const Rigid3 flipped = moved(kTrue, 1.4, 0.02);
  o.terms = {std::make_shared<PullTo>(flipped, "fiducial")};
  o.hypotheses = {{flipped, 0.0}, {kTrue, 9.0}};
  const Observation again =
      thaw(*freeze(o, track_at(kTrue).get()), ObjectId(0), CameraId(0), o.capture);
  ASSERT_EQ(again.terms.size(), 1U);
  EXPECT_NEAR(again.terms[0]->linearize(flipped).cost, 0, 1e-9);
  EXPECT_NEAR(again.terms[0]->linearize(kTrue).cost, o.terms[0]->linearize(kTrue).cost, 1e-6);
}

TEST(FrozenObservation, WhatSawNothingSaysNothing) {
  Observation o = observation();
  o.terms.clear();
  EXPECT_TRUE(thaw(*freeze(o, nullptr), ObjectId(0), CameraId(0), o.capture).terms.empty());
  EXPECT_FALSE(freeze(observation(), nullptr)) << "it saw the object, but there is no pose";
}

// The estimator's rules go by them: for cameras of other hosts as for those here.
TEST(FrozenObservation, KindsComeBack) {
  const std::pair<std::string_view, std::string_view> kinds[] = {
      {"fiducial", "fiducial"}, {"texture", "texture"}, {"sparse_texture", "region"},
      {"region", "region"},     {"edge", "region"},     {"detection", "region"}};
  for (const auto& [kind, expected] : kinds) {
    Observation o = observation();
    o.terms = {std::make_shared<PullTo>(kTrue, kind)};
    const auto again = thaw(*freeze(o, track_at(kTrue).get()), ObjectId(0), CameraId(0), o.capture);
    ASSERT_EQ(again.terms.size(), 1U) << kind;
    EXPECT_EQ(again.terms[0]->kind(), expected);
  }
}

TEST(FrozenObservation, WhatIsNotKnownOfTheCamerasPlaceComesBack) {
  Observation o = observation();
  EXPECT_FALSE(freeze(o, track_at(kTrue).get())->calibration_covariance);
  o.calibration_covariance = std::make_shared<const Matrix6>(some_information());
  const auto again = thaw(*freeze(o, track_at(kTrue).get()), ObjectId(0), CameraId(0), o.capture);
  ASSERT_TRUE(again.calibration_covariance);
  EXPECT_EQ(*again.calibration_covariance, some_information());
}

}  // namespace
}  // namespace sightline
