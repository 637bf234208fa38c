// SPDX-License-Identifier: Apache-2.0
// The estimator's parts one by one: quantiles, Jacobians, update, gating.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "fuse/update/camera_system.hpp"
#include "fuse/update/chi_square.hpp"
#include "fuse/update/gating.hpp"
#include "fuse/update/pose_update.hpp"
#include "support/random.hpp"
#include "support/reprojection_term.hpp"
#include "support/synthetic_rig.hpp"

namespace sightline::fuse {
namespace {

using test::Random;
using test::RigOptions;
using test::SyntheticRig;

TEST(ChiSquare, QuantilesMatchTables) {
  EXPECT_NEAR(chi_square_quantile(0.999, 1), 10.828, 1e-3);
  EXPECT_NEAR(chi_square_quantile(0.999, 6), 22.458, 1e-3);
  EXPECT_NEAR(chi_square_quantile(0.95, 2), 5.991, 1e-3);
  EXPECT_NEAR(chi_square_quantile(0.975, 40), 59.342, 1e-3);
  EXPECT_NEAR(chi_square_quantile(0.975, 100), 129.561, 0.05);
  EXPECT_NEAR(chi_square_cdf(12.592, 6), 0.95, 1e-4);
  const ChiSquareTable table(0.999);
  EXPECT_NEAR(table.at(6), 22.458, 1e-3);
  EXPECT_NEAR(table.at(200), 267.54, 0.3);
}

// One image of the cube from each camera of a rig, all at one time.
std::vector<Observation> one_set(int cameras, double pixel_sigma, uint64_t seed,
                                 Duration capture_error = Duration(0)) {
  RigOptions options;
  options.cameras = cameras;
  options.arc = 1.05 * (cameras - 1);
  options.phases.assign(static_cast<size_t>(cameras), 0.0);
  options.duration = std::chrono::milliseconds(20);
  options.pixel_sigma = pixel_sigma;
  options.claimed_pixel_sigma = 0.3;
  options.motion.kind = test::MotionKind::kStill;
  options.seed = seed;
  const SyntheticRig rig(options);
  std::vector<Observation> set = rig.sets().front();
  for (Observation& observation : set) observation.capture_error = capture_error;
  return set;
}

std::vector<CameraMeasurement> measurements_of(const std::vector<Observation>& set) {
  std::vector<CameraMeasurement> measurements;
  for (const Observation& observation : set) measurements.push_back({&observation, 1.0, 1.0, 0, 0});
  return measurements;
}

Matrix6 square(const Vector6& v) { return v * v.transpose(); }

Vector6 some_twist() {
  Vector6 twist;
  twist << 0.5, -1.0, 2.0, 0.4, -0.3, 0.6;
  return twist;
}

TEST(CameraSystem, GradientAndInformationMatchNumericDerivatives) {
  for (const Duration error : {Duration(0), Duration(std::chrono::milliseconds(3))}) {
    const auto set = one_set(1, 0.3, 3, error);
    const CameraMeasurement measurement{&set[0], 2.5, 1.0, 0, 0};
    Vector6 off;
    off << 0.01, -0.02, 0.015, 0.001, 0.002, -0.001;
    const Rigid3 pose = Rigid3::exp(off);
    const CameraSystem at = linearize(measurement, pose, square(some_twist()));
    constexpr double kStep = 1e-5;
    for (int i = 0; i < 6; ++i) {
      const Vector6 d = kStep * Vector6::Unit(i);
      const CameraSystem plus = linearize(measurement, pose * Rigid3::exp(d), square(some_twist()));
      const CameraSystem minus =
          linearize(measurement, pose * Rigid3::exp(-d), square(some_twist()));
      const double slope = (plus.cost - minus.cost) / (2 * kStep);
      // The time error is integrated out in a linearized way, exact to first order at the minimum.
      const double tolerance = error == Duration(0) ? 1e-5 : 0.05;
      EXPECT_NEAR(slope, at.gradient[i], tolerance * (1.0 + at.gradient.norm())) << i;
    }
  }
}

TEST(CameraSystem, TimeErrorAddsToTheCovarianceAlongTheTwist) {
  const auto sure = one_set(2, 0.3, 5);
  const auto unsure = one_set(2, 0.3, 5, std::chrono::milliseconds(4));
  const Rigid3 pose;
  const CameraSystem a = linearize({&sure[0], 1.0, 1.0, 0, 0}, pose, square(some_twist()));
  const CameraSystem b = linearize({&unsure[0], 1.0, 1.0, 0, 0}, pose, square(some_twist()));
  const Matrix6 grown =
      a.information.inverse() + 0.004 * 0.004 / 3.0 * some_twist() * some_twist().transpose();
  const Matrix6 expected = grown.inverse();
  EXPECT_LT((b.information - expected).norm(), 1e-6 * expected.norm());
}

TEST(CameraSystem, NumbersThatAreNotFiniteSaySilence) {
  struct Broken : PoseTerm {
    LinearizedTerm linearize(const Rigid3&) const override {
      LinearizedTerm term;
      term.cost = std::numeric_limits<double>::quiet_NaN();
      term.residuals = 8;
      term.quality = 1;
      return term;
    }
    std::string_view kind() const override { return "broken"; }
  };
  Observation observation;
  observation.terms.push_back(std::make_shared<Broken>());
  const CameraSystem system = linearize({&observation, 1.0, 1.0, 0, 0}, Rigid3(), Matrix6::Zero());
  EXPECT_FALSE(system.usable(0.0));
  EXPECT_EQ(system.information.norm(), 0.0);
}

PoseEstimate prior_estimate(double sigma_r, double sigma_t) {
  PoseEstimate prior;
  prior.twist = some_twist();
  Random random(11);
  Eigen::Matrix<double, 12, 12> root;
  for (double& v : root.reshaped()) v = 0.3 * random.normal();
  root.diagonal().array() += 1.0;
  Eigen::Matrix<double, 12, 1> scale;
  scale << Eigen::Vector3d::Constant(sigma_r), Eigen::Vector3d::Constant(sigma_t),
      Eigen::Vector3d::Constant(10 * sigma_r), Eigen::Vector3d::Constant(10 * sigma_t);
  prior.covariance = scale.asDiagonal() * (root * root.transpose()).eval() * scale.asDiagonal();
  return prior;
}

// The update must agree with the textbook: minimize over all 12 states at once, numerically.
TEST(PoseUpdate, EqualsTheJointMinimumOverPoseAndTwist) {
  const auto set = one_set(2, 0.3, 7);
  const auto measurements = measurements_of(set);
  const PoseEstimate prior = prior_estimate(0.05, 0.01);
  Minimizer minimizer(20);
  PoseMinimum minimum;
  minimizer.run(pose_prior(prior), measurements, prior.world_from_object, minimum);
  const PoseEstimate result = posterior(prior, minimum);

  using Vector12 = Eigen::Matrix<double, 12, 1>;
  using Matrix12 = Eigen::Matrix<double, 12, 12>;
  const Matrix12 information = prior.covariance.inverse();
  const auto cost = [&](const Rigid3& pose, const Vector6& twist) {
    Vector12 e;
    e << difference(prior.world_from_object, pose), twist - prior.twist;
    double sum = 0.5 * e.dot(information * e);
    for (const CameraMeasurement& measurement : measurements)
      sum += linearize(measurement, pose, square(prior.twist)).cost;
    return sum;
  };
  const auto moved = [&](const Vector12& d) {
    return cost(result.world_from_object * Rigid3::exp(d.head<6>()), result.twist + d.tail<6>());
  };
  Vector12 sigma = result.covariance.diagonal().cwiseSqrt();
  const double best = moved(Vector12::Zero());
  for (int i = 0; i < 12; ++i) {
    const double h = 1e-3 * sigma[i];
    const Vector12 d = h * Vector12::Unit(i);
    // Slope in units of the standard deviation: nought at the minimum.
    EXPECT_NEAR((moved(d) - moved(-d)) / (2e-3), 0.0, 2e-3) << i;
  }
  // Curvature of the cost is the inverse covariance (Gauss-Newton: to a few per cent).
  const Matrix12 inverse = result.covariance.inverse();
  for (int i = 0; i < 12; ++i) {
    const double h = 0.05 * sigma[i];
    const Vector12 d = h * Vector12::Unit(i);
    const double curvature = (moved(d) + moved(-d) - 2 * best) / (h * h);
    EXPECT_NEAR(curvature / inverse(i, i), 1.0, 0.05) << i;
  }
}

TEST(PoseUpdate, ConvergesFromFarAway) {
  const auto set = one_set(3, 0.0, 9);
  const auto measurements = measurements_of(set);
  PoseEstimate prior = prior_estimate(1.0, 0.5);
  Vector6 off;
  off << 0.3, -0.25, 0.2, 0.05, -0.04, 0.06;
  prior.world_from_object = Rigid3::exp(off);
  Minimizer minimizer(30);
  PoseMinimum minimum;
  minimizer.run(pose_prior(prior), measurements, prior.world_from_object, minimum);
  EXPECT_LT(translation_distance(minimum.pose, Rigid3()), 1e-4);
  EXPECT_LT(rotation_angle(minimum.pose, Rigid3()), 1e-3);
}

// The gate's statistic is a chi-square variable of six degrees of freedom for a right measurement:
// one in a thousand is refused, whatever prior and camera know.
TEST(Gating, RightMeasurementsPassTheGate) {
  Gating gating{EstimatorOptions{}};
  GatedUpdate update;
  Random random(5);
  int refused = 0;
  constexpr int kTrials = 400;
  for (int i = 0; i < kTrials; ++i) {
    const auto set = one_set(1, 0.3, 1000 + static_cast<uint64_t>(i));
    PoseEstimate prior = prior_estimate(0.01, 0.002);
    const Eigen::LLT<Matrix6> root(prior.pose_covariance());
    prior.world_from_object = Rigid3::exp(-(root.matrixL() * random.normal<6>()));
    gating.run(pose_prior(prior), measurements_of(set), prior.world_from_object, update);
    refused += update.accepted == 0 ? 1 : 0;
  }
  EXPECT_LE(refused, 3);
}

TEST(Gating, OneOfThreeThatContradictsIsRefused) {
  auto set = one_set(3, 0.3, 21);
  auto wrong = one_set(3, 0.3, 22);
  Vector6 off;
  off << 0, 0, 0.1, 0.02, 0, 0;
  struct Moved : PoseTerm {
    PoseTermPtr inner;
    Rigid3 by;
    LinearizedTerm linearize(const Rigid3& pose) const override {
      // Numbers of the right place, claimed for another one; exact enough for a gate test.
      return inner->linearize(pose * by);
    }
    std::string_view kind() const override { return "moved"; }
  };
  auto moved = std::make_shared<Moved>();
  moved->inner = wrong[1].terms[0];
  moved->by = Rigid3::exp(off);
  set[1].terms = {moved};
  set[1].hypotheses.clear();
  Gating gating{EstimatorOptions{}};
  GatedUpdate update;
  const PoseEstimate loose = prior_estimate(0.3, 0.1);
  gating.run(pose_prior(loose), measurements_of(set), Rigid3(), update);
  EXPECT_EQ(update.accepted, camera_bit(CameraId(0)) | camera_bit(CameraId(2)));
  EXPECT_EQ(update.gated, camera_bit(CameraId(1)));
  EXPECT_LT(translation_distance(update.minimum.pose, Rigid3()), 0.002);
}

TEST(Gating, ResidualsLargerThanClaimedWidenTheCovariance) {
  const auto honest = one_set(2, 0.3, 31);
  const auto liar = one_set(2, 1.2, 31);
  Gating gating{EstimatorOptions{}};
  const PoseEstimate loose = prior_estimate(0.3, 0.1);
  GatedUpdate a, b;
  gating.run(pose_prior(loose), measurements_of(honest), Rigid3(), a);
  gating.run(pose_prior(loose), measurements_of(liar), Rigid3(), b);
  ASSERT_NE(b.accepted, 0u);
  const double ratio = a.minimum.camera_information()(5, 5) / b.minimum.camera_information()(5, 5);
  EXPECT_GT(ratio, 4.0);
  EXPECT_LT(ratio, 40.0);
}

}  // namespace
}  // namespace sightline::fuse
