// SPDX-License-Identifier: Apache-2.0
// What cameras that differ in every frame are found out by, and what is no reason to suspect them.
#include "fuse/update/innovation_bias.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "support/random.hpp"

namespace sightline::fuse {
namespace {

using test::Random;

// Fifty frames of two cameras whose innovations are white but for a steady offset [rad, m], the
// other way round in the second one. `sigma`: of one frame.
BankState two_cameras(const Vector6& sigma, const Vector6& steady, double white, uint64_t seed) {
  Random random(seed);
  BankState state;
  const Vector6 information = sigma.cwiseAbs2().cwiseInverse();
  for (int frame = 0; frame < 50; ++frame) {
    for (size_t camera = 0; camera < 2; ++camera) {
      Vector6 offset = camera == 0 ? steady : Vector6(-steady);
      for (int i = 0; i < 6; ++i) offset[i] += white * sigma[i] * random.normal();
      InformationInnovation innovation;
      innovation.vector = information.cwiseProduct(offset).cast<float>();
      innovation.information = Matrix6(information.asDiagonal()).cast<float>();
      add_innovation(innovation, state.cameras[camera]);
    }
  }
  return state;
}

Vector6 sigmas(double rotation, double translation) {
  Vector6 sigma;
  sigma << Eigen::Vector3d::Constant(rotation), Eigen::Vector3d::Constant(translation);
  return sigma;
}

double mean_share(const Vector6& sigma, const Vector6& steady, double white) {
  double sum = 0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    sum += bias_share(0b11, {}, two_cameras(sigma, steady, white, seed)) / 20;
  }
  return sum;
}

TEST(InnovationBias, WhiteInnovationsAreNone) {
  EXPECT_LT(mean_share(sigmas(0.01, 0.001), Vector6::Zero(), 1), 0.002);
}

TEST(InnovationBias, CamerasThatAreOffAreFoundOut) {
  // Two cameras whose innovations go on 0.5 sigma of the largest systematic error to either side.
  const EstimatorOptions options;
  const Vector6 largest = sigmas(options.systematic_rotation, options.systematic_translation);
  const double share = mean_share(sigmas(0.002, 0.0005), 0.5 * largest, 1);
  EXPECT_GT(share, 0.25);
  EXPECT_LT(share, 1.0);
}

TEST(InnovationBias, AWeakDirectionAloneIsNoReason) {
  // An outline in one camera: its distance is off by one of its sigmas in every frame, as it may
  // be; all other directions say that the cameras stand where they should (the mean over all six
  // would say 0.17).
  Vector6 sigma = sigmas(0.01, 0.0005);
  sigma[5] = 0.006;
  Vector6 steady = Vector6::Zero();
  steady[5] = 0.006;
  EXPECT_LT(mean_share(sigma, steady, 1), 0.03);
}

TEST(InnovationBias, OneCameraAlonePersistsAsItsFramesSay) {
  const Vector6 sigma = sigmas(0.01, 0.002);
  const BankState state = two_cameras(sigma, Vector6::Zero(), 1, 1);
  const Rigid3 turned = Rigid3::exp((Vector6() << 0.3, -0.5, 0.2, 1, 2, 3).finished());
  const Matrix6 covariance = persistent_covariance(state.cameras[0], turned);
  EXPECT_NEAR(covariance(0, 0) / (sigma[0] * sigma[0]), 1.5, 0.01);
  EXPECT_NEAR(covariance(4, 4) / (sigma[4] * sigma[4]), 1.5, 0.01);
  EXPECT_TRUE(persistent_covariance(CameraRecord{}, turned).isZero(0.0));
}

}  // namespace
}  // namespace sightline::fuse
