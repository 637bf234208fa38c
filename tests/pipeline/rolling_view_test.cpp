// SPDX-License-Identifier: Apache-2.0
#include "pipeline/view/rolling_view.hpp"

#include <gtest/gtest.h>

#include "sightline/geometry/rolling_shutter.hpp"
#include "support/lens_camera.hpp"

namespace sightline::pipeline {
namespace {

using namespace std::chrono_literals;

constexpr Time kCapture{5s};
constexpr double kReadout = 0.03;  // [s]
const Eigen::Vector3d kCenter(0.02, -0.01, 0.03);

CalibratedCamera camera(double readout_s = kReadout) {
  CalibratedCamera out = test::lens_camera();
  Vector6 place;
  place << 0.3, -0.2, 0.1, 0.2, -0.1, 0.05;
  out.world_from_camera = Rigid3::exp(place);
  out.readout_s = readout_s;
  return out;
}

// Seen 150 rows below the middle, in motion.
PoseEstimate moving(Time time) {
  PoseEstimate out;
  out.object = ObjectId(0);
  out.time = out.last_measured = time;
  out.state = TrackState::kTracking;
  Vector6 turned;
  turned << 0.4, 0.2, -0.3, 0, 0, 0;
  out.world_from_object = camera().world_from_camera *
                          Rigid3(Eigen::Quaterniond::Identity(), {0.1, 0.25, 1}) *
                          Rigid3::exp(turned) * Rigid3(Eigen::Quaterniond::Identity(), -kCenter);
  out.twist << 1.5, -1, 2, 0.6, -0.4, 0.5;
  out.covariance.diagonal().setConstant(1e-6);
  return out;
}

// At the times of the estimates it moves on as its twist says.
PoseTrackPtr track(const std::vector<Duration>& ages) {
  const PoseEstimate now = moving(kCapture);
  std::vector<PoseEstimate> history;
  for (const Duration age : ages) {
    history.push_back(now);
    history.back().time = history.back().last_measured = kCapture - age;
    history.back().world_from_object =
        now.world_from_object * Rigid3::exp(-to_seconds(age) * now.twist);
  }
  return std::make_shared<const PoseTrack>(ObjectId(0), std::move(history), MotionNoise{});
}

FrameInfo frame() {
  FrameInfo info;
  info.capture = kCapture;
  return info;
}

// By how much later than the frame the row is exposed in which the object is then.
Duration delay(double readout_s = kReadout) {
  const CalibratedCamera rolling = camera(readout_s);
  const PoseEstimate now = moving(kCapture);
  double delay_s = 0;
  for (int round = 0; round < 2; ++round) {
    const Rigid3 there = now.world_from_object * Rigid3::exp(delay_s * now.twist);
    delay_s = row_delay_s(rolling, rolling.world_from_camera.inverse() * (there * kCenter));
  }
  return from_seconds(delay_s);
}

// Where the object was measured: cost |log(measured^-1 pose)|^2 / 2.
class PoseMeasurement final : public PoseTerm {
 public:
  explicit PoseMeasurement(const Rigid3& measured) : measured_(measured) {}
  LinearizedTerm linearize(const Rigid3& world_from_object) const override {
    LinearizedTerm out;
    const Vector6 off = difference(measured_, world_from_object);
    const Matrix6 by_tangent = right_jacobian_inverse(off);
    out.cost = 0.5 * off.squaredNorm();
    out.gradient = by_tangent.transpose() * off;
    out.information = by_tangent.transpose() * by_tangent;
    out.residuals = 6;
    return out;
  }
  std::string_view kind() const override { return "measurement"; }

 private:
  const Rigid3 measured_;
};

TEST(RollingView, TracksAreAtTheTimeOfTheRow) {
  ASSERT_GT(delay(), 8ms);
  for (const auto& ages : {std::vector<Duration>{60ms, 30ms}, {60ms, 0ms, -30ms}}) {
    const PoseTrackPtr known = track(ages);
    RollingView view(camera(), {kCenter});
    view.look(frame(), std::span(&known, 1));
    ASSERT_EQ(view.tracks().size(), 1u);
    for (const Duration ago : {0ms, 33ms}) {
      const PoseAt seen = view.tracks()[0]->at(kCapture - ago);
      const PoseAt truth = known->at(kCapture - ago + delay());
      EXPECT_EQ(seen.source, truth.source);
      EXPECT_EQ(seen.estimate.state, truth.estimate.state);
      EXPECT_LT(
          difference(seen.estimate.world_from_object, truth.estimate.world_from_object).norm(),
          1e-9);
      EXPECT_LT((seen.estimate.covariance - truth.estimate.covariance).norm(), 1e-12);
      EXPECT_EQ(seen.estimate.time, kCapture - ago);
    }
  }
}

TEST(RollingView, WhatWasMeasuredIsSaidOfTheFramesTime) {
  const PoseTrackPtr known = track({60ms, 30ms});
  RollingView view(camera(), {kCenter});
  view.look(frame(), std::span(&known, 1));
  const Rigid3 then = known->at(kCapture + delay()).estimate.world_from_object;
  const Rigid3 now = known->at(kCapture).estimate.world_from_object;
  ASSERT_GT(difference(now, then).tail<3>().norm(), 0.005);

  Observation observation;
  observation.object = ObjectId(0);
  observation.terms.push_back(std::make_shared<PoseMeasurement>(then));
  observation.hypotheses.push_back({then, 0});
  observation.symmetric_hypotheses.push_back({then, 0});
  view.bring_back(std::span(&observation, 1));
  EXPECT_LT(difference(observation.hypotheses[0].world_from_object, now).norm(), 1e-9);
  EXPECT_LT(difference(observation.symmetric_hypotheses[0].world_from_object, now).norm(), 1e-9);
  EXPECT_EQ(observation.terms[0]->kind(), "measurement");
  EXPECT_LT(observation.terms[0]->linearize(now).cost, 1e-15);

  // The gradient is that of the cost by the tangent of the pose that is asked about.
  Vector6 off;
  off << 0.05, -0.03, 0.02, 0.04, 0.01, -0.02;
  const Rigid3 pose = now * Rigid3::exp(off);
  const LinearizedTerm term = observation.terms[0]->linearize(pose);
  for (int k = 0; k < 6; ++k) {
    const Vector6 step = 1e-5 * Vector6::Unit(k);
    const auto cost = [&](const Vector6& d) {
      return observation.terms[0]->linearize(pose * Rigid3::exp(d)).cost;
    };
    EXPECT_NEAR(term.gradient(k), (cost(step) - cost(-step)) / 2e-5, 1e-7);
  }
  const Vector6 to_minimum = -term.information.ldlt().solve(term.gradient);
  EXPECT_LT(difference(pose * Rigid3::exp(to_minimum), now).norm(), 2e-3);
}

TEST(RollingView, LeavesWhatItDoesNotKnow) {
  RollingView view(camera(), {kCenter});
  const std::vector<PoseTrackPtr> unknown = {
      nullptr,
      std::make_shared<const PoseTrack>(ObjectId(0), std::vector<PoseEstimate>{}, MotionNoise{})};
  view.look(frame(), unknown);
  EXPECT_EQ(view.tracks()[0], nullptr);
  EXPECT_EQ(view.tracks()[1], unknown[1]);
  Observation observation;
  observation.object = ObjectId(0);
  const Rigid3 pose = moving(kCapture).world_from_object;
  observation.hypotheses.push_back({pose, 0});
  view.bring_back(std::span(&observation, 1));
  EXPECT_EQ(difference(observation.hypotheses[0].world_from_object, pose).norm(), 0);
}

TEST(RollingView, AsTheShutterRollsTheOtherWay) {
  const PoseTrackPtr known = track({30ms});
  ASSERT_LT(delay(-kReadout), -8ms);
  RollingView view(camera(-kReadout), {kCenter});
  view.look(frame(), std::span(&known, 1));
  EXPECT_LT(difference(view.tracks()[0]->at(kCapture).estimate.world_from_object,
                       known->at(kCapture + delay(-kReadout)).estimate.world_from_object)
                .norm(),
            1e-9);
}

}  // namespace
}  // namespace sightline::pipeline
