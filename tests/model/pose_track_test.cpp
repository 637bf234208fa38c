// SPDX-License-Identifier: Apache-2.0
#include "sightline/model/pose_track.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <random>

namespace sightline {
namespace {

using Matrix12 = Eigen::Matrix<double, 12, 12>;
using Vector12 = Eigen::Matrix<double, 12, 1>;

constexpr Time at_ms(int64_t ms) { return time_from_ns(ms * 1'000'000); }

PoseEstimate estimate_at(int64_t ms, TrackState state = TrackState::kTracking) {
  PoseEstimate estimate;
  estimate.object = ObjectId(1);
  estimate.time = estimate.last_measured = at_ms(ms);
  estimate.state = state;
  Vector6 pose;
  pose << 0.3, -0.2, 0.9, 0.5, 1.5, -0.7;
  estimate.world_from_object = Rigid3::exp(pose);
  estimate.twist << 0.8, -1.5, 2.0, 0.6, -0.3, 0.4;
  estimate.cameras = 3;
  Vector12 sigma;
  sigma << 0.01, 0.02, 0.015, 0.002, 0.003, 0.001, 0.1, 0.2, 0.15, 0.05, 0.02, 0.03;
  estimate.covariance = sigma.array().square().matrix().asDiagonal();
  estimate.covariance(0, 6) = estimate.covariance(6, 0) = 0.5 * sigma(0) * sigma(6);
  estimate.covariance(4, 10) = estimate.covariance(10, 4) = -0.4 * sigma(4) * sigma(10);
  return estimate;
}

double smallest_eigenvalue(const Matrix12& m) {
  return Eigen::SelfAdjointEigenSolver<Matrix12>(m).eigenvalues().minCoeff();
}

// Spread of the predicted states of samples around the prediction.
Matrix12 sampled_covariance(const PoseEstimate& from, const PoseEstimate& to, double dt) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  const Matrix12 root = from.covariance.llt().matrixL();
  Matrix12 sum = Matrix12::Zero();
  const int samples = 40000;
  for (int i = 0; i < samples; ++i) {
    const Vector12 d = root * Vector12::NullaryExpr([&](Eigen::Index) { return normal(random); });
    const Vector6 twist = from.twist + d.tail<6>();
    const Rigid3 pose = from.world_from_object * Rigid3::exp(d.head<6>()) * Rigid3::exp(twist * dt);
    Vector12 error;
    error << difference(to.world_from_object, pose), twist - to.twist;
    sum += error * error.transpose();
  }
  return sum / samples;
}

TEST(Predict, CovarianceIsThatOfSamples) {
  const PoseEstimate from = estimate_at(0);
  for (const int ms : {150, -150}) {
    const PoseEstimate to = predict(from, at_ms(ms), MotionNoise{0, 0});
    const Matrix12 sampled = sampled_covariance(from, to, ms * 1e-3);
    const Vector12 scale = sampled.diagonal().cwiseSqrt();
    const Matrix12 difference = scale.cwiseInverse().asDiagonal() * (to.covariance - sampled) *
                                scale.cwiseInverse().asDiagonal();
    EXPECT_LT(difference.cwiseAbs().maxCoeff(), 0.04) << ms;
  }
}

TEST(Predict, FollowsTheTwistThereAndBack) {
  const PoseEstimate from = estimate_at(0);
  const PoseEstimate to = predict(from, at_ms(200), MotionNoise{});
  EXPECT_LT(difference(to.world_from_object, from.world_from_object * Rigid3::exp(0.2 * from.twist))
                .norm(),
            1e-12);
  EXPECT_EQ(to.time, at_ms(200));
  EXPECT_EQ(to.last_measured, at_ms(0));
  EXPECT_EQ(to.state, from.state);
  EXPECT_EQ(to.cameras, from.cameras);
  const PoseEstimate back = predict(to, at_ms(0), MotionNoise{});
  EXPECT_LT(difference(back.world_from_object, from.world_from_object).norm(), 1e-12);
}

TEST(Predict, TwoStepsEqualOneInPoseAndCovariance) {
  const PoseEstimate from = estimate_at(0);
  PoseEstimate slow = from;
  slow.twist.setZero();  // the process noise is added in the frame at the end of the step
  const PoseEstimate once = predict(slow, at_ms(100), MotionNoise{});
  const PoseEstimate twice =
      predict(predict(slow, at_ms(40), MotionNoise{}), at_ms(100), MotionNoise{});
  EXPECT_LT((once.covariance - twice.covariance).norm(), 1e-12);
  const PoseEstimate a = predict(from, at_ms(100), MotionNoise{0, 0});
  const PoseEstimate b =
      predict(predict(from, at_ms(40), MotionNoise{0, 0}), at_ms(100), MotionNoise{0, 0});
  EXPECT_LT((a.covariance - b.covariance).norm(), 1e-12);
  EXPECT_LT(difference(a.world_from_object, b.world_from_object).norm(), 1e-12);
}

TEST(Predict, NoiseGrowsAsWhiteAccelerationDoes) {
  PoseEstimate from = estimate_at(0);
  from.twist.setZero();
  from.covariance.setZero();
  const MotionNoise noise{3, 2};
  const PoseEstimate to = predict(from, at_ms(300), noise);
  const double t = 0.3;
  EXPECT_NEAR(to.covariance(1, 1), 9 * t * t * t / 3, 1e-12);
  EXPECT_NEAR(to.covariance(4, 4), 4 * t * t * t / 3, 1e-12);
  EXPECT_NEAR(to.covariance(4, 10), 4 * t * t / 2, 1e-12);
  EXPECT_NEAR(to.covariance(7, 7), 9 * t, 1e-12);
  const PoseEstimate back = predict(from, at_ms(-300), noise);
  EXPECT_NEAR(back.covariance(4, 4), to.covariance(4, 4), 1e-12);
  EXPECT_NEAR(back.covariance(4, 10), -to.covariance(4, 10), 1e-12);
  EXPECT_GT(smallest_eigenvalue(predict(estimate_at(0), at_ms(-300), noise).covariance), 0);
}

TEST(PoseEstimate, SigmasAreThoseOfTheWorstDirection) {
  PoseEstimate estimate;
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).matrix();
  estimate.covariance.topLeftCorner<3, 3>() =
      turn * Eigen::Vector3d(1e-4, 4e-4, 9e-4).asDiagonal() * turn.transpose();
  estimate.covariance.block<3, 3>(3, 3) =
      turn * Eigen::Vector3d(1e-6, 16e-6, 1e-6).asDiagonal() * turn.transpose();
  EXPECT_NEAR(estimate.sigma_rotation(), 0.03, 1e-9);
  EXPECT_NEAR(estimate.sigma_translation(), 0.004, 1e-9);
}

TEST(PoseTrack, NothingIsKnownWithoutHistoryOrBeforeIt) {
  EXPECT_EQ(PoseTrack(ObjectId(1), {}, {}).at(at_ms(5)).source, PoseSource::kNone);
  const PoseTrack track(ObjectId(1), {estimate_at(10)}, {});
  EXPECT_EQ(track.at(at_ms(9)).source, PoseSource::kNone);
}

TEST(PoseTrack, AnExactTimeGivesTheEstimateItself) {
  const PoseTrack track(ObjectId(1), {estimate_at(10), estimate_at(20), estimate_at(30)}, {});
  for (const int ms : {10, 20, 30}) {
    const PoseAt pose = track.at(at_ms(ms));
    EXPECT_EQ(pose.source, PoseSource::kEstimated);
    EXPECT_EQ(pose.estimate.cameras, 3u);
    EXPECT_EQ(pose.estimate.time, at_ms(ms));
  }
}

TEST(PoseTrack, InterpolatesAlongAConstantTwist) {
  const PoseEstimate a = estimate_at(0);
  PoseEstimate b = predict(a, at_ms(40), MotionNoise{});
  b.last_measured = b.time;
  const PoseTrack track(ObjectId(1), {a, b}, {});
  for (int ms = 1; ms < 40; ++ms) {
    const PoseAt pose = track.at(at_ms(ms));
    ASSERT_EQ(pose.source, PoseSource::kInterpolated);
    const Rigid3 expected = a.world_from_object * Rigid3::exp(a.twist * (ms * 1e-3));
    EXPECT_LT(difference(expected, pose.estimate.world_from_object).norm(), 1e-12);
    EXPECT_LT((pose.estimate.twist - a.twist).norm(), 1e-12);
    EXPECT_EQ(pose.estimate.time, at_ms(ms));
    EXPECT_EQ(pose.estimate.last_measured, a.last_measured);
    EXPECT_EQ(pose.estimate.cameras, 0u);
    // Between the neighbors, also as matrices.
    EXPECT_GE(pose.estimate.sigma_translation(), a.sigma_translation() * (1 - 1e-9));
    EXPECT_LE(pose.estimate.sigma_translation(), b.sigma_translation() * (1 + 1e-9));
    EXPECT_GT(smallest_eigenvalue(pose.estimate.covariance), 0);
  }
}

TEST(PoseTrack, TheWeakerNeighborNamesTheState) {
  const auto state_between = [](TrackState a, TrackState b) {
    const PoseTrack track(ObjectId(1), {estimate_at(0, a), estimate_at(40, b)}, {});
    return track.at(at_ms(20));
  };
  using enum TrackState;
  EXPECT_EQ(state_between(kTracking, kDegraded).estimate.state, kDegraded);
  EXPECT_EQ(state_between(kDegraded, kTracking).estimate.state, kDegraded);
  EXPECT_EQ(state_between(kCoasting, kTracking).estimate.state, kCoasting);
  EXPECT_EQ(state_between(kLost, kTracking).source, PoseSource::kNone);
  EXPECT_EQ(state_between(kTracking, kLost).source, PoseSource::kNone);
  EXPECT_EQ(state_between(kSearching, kTracking).source, PoseSource::kNone);
  const PoseTrack lost(ObjectId(1), {estimate_at(0, kLost)}, {});
  EXPECT_EQ(lost.at(at_ms(0)).source, PoseSource::kNone);
  EXPECT_EQ(lost.at(at_ms(1)).source, PoseSource::kNone);
}

TEST(PoseTrack, PredictsAfterTheEndThenCoastsThenRefuses) {
  const PoseEstimate last = estimate_at(0);
  const MotionNoise noise{};
  const PoseTrack track(ObjectId(1), {last}, noise);
  const Time fresh = last.time + PoseTrack::kFreshFor;
  EXPECT_EQ(track.at(fresh).source, PoseSource::kPredicted);
  EXPECT_EQ(track.at(fresh).estimate.state, TrackState::kTracking);
  EXPECT_EQ(track.at(fresh).estimate.cameras, 0u);
  EXPECT_EQ(track.at(fresh + Duration(1)).estimate.state, TrackState::kCoasting);
  const Time end = last.time + PoseTrack::kCoastLimit;
  EXPECT_EQ(track.at(end).source, PoseSource::kPredicted);
  EXPECT_EQ(track.at(end + Duration(1)).source, PoseSource::kNone);
  EXPECT_LT((track.at(fresh).estimate.covariance - predict(last, fresh, noise).covariance).norm(),
            1e-15);
  double sigma = 0;
  for (int ms = 1; ms <= 700; ms += 50) {
    const double next = track.at(at_ms(ms)).estimate.sigma_translation();
    EXPECT_GT(next, sigma);
    sigma = next;
  }
}

TEST(PoseTrack, AgeCountsFromTheLastMeasurementNotFromTheLastEstimate) {
  PoseEstimate coasting = estimate_at(600, TrackState::kCoasting);
  coasting.last_measured = at_ms(0);
  const PoseTrack track(ObjectId(1), {coasting}, {});
  EXPECT_EQ(track.at(at_ms(700)).source, PoseSource::kPredicted);
  EXPECT_EQ(track.at(at_ms(701)).source, PoseSource::kNone);
}

TEST(PoseTrack, StatesAreNamedAsInThePoseLog) {
  EXPECT_EQ(to_string(TrackState::kSearching), "searching");
  EXPECT_EQ(to_string(TrackState::kTracking), "tracking");
  EXPECT_EQ(to_string(TrackState::kDegraded), "degraded");
  EXPECT_EQ(to_string(TrackState::kCoasting), "coasting");
  EXPECT_EQ(to_string(TrackState::kLost), "lost");
}

}  // namespace
}  // namespace sightline
