// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/rigid3.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <numbers>
#include <random>

#include "sightline/geometry/rotation_between.hpp"
#include "support/matchers.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;
using test::MatrixNear;
using test::PoseNear;

constexpr double kPi = std::numbers::pi;

class Rigid3Law : public testing::Test {
 protected:
  /// Tangent with a rotation of the given angle about a random axis.
  Vector6 tangent(double angle, double length = 1.0) {
    Vector6 x;
    x << angle * direction(), length * direction();
    return x;
  }
  Vector6 tangent() { return tangent(3.0 * uniform_(rng_)); }
  Rigid3 pose() { return Rigid3::exp(tangent()); }
  Eigen::Vector3d direction() {
    return Eigen::Vector3d(normal_(rng_), normal_(rng_), normal_(rng_)).normalized();
  }
  Vector6 noise(double sigma) {
    Vector6 x;
    for (int i = 0; i < 6; ++i) x(i) = sigma * normal_(rng_);
    return x;
  }

  std::mt19937 rng_{7};
  std::normal_distribution<double> normal_;
  std::uniform_real_distribution<double> uniform_;
};

/// Angles where implementations usually break: zero, tiny, the switch to the series, and pi.
const double kAngles[] = {0.0,    1e-12, 1e-9,   1e-6, 1e-4,      1e-2,       0.1,
                          0.4999, 0.5,   0.5001, 1.0,  kPi - 0.1, kPi - 1e-4, kPi - 1e-8};

TEST_F(Rigid3Law, LogInvertsExp) {
  for (double angle : kAngles) {
    for (int i = 0; i < 20; ++i) {
      const Vector6 x = tangent(angle, 2.0);
      EXPECT_THAT(Rigid3::exp(x).log(), MatrixNear(x, 1e-8)) << "angle " << angle;
    }
  }
}

TEST_F(Rigid3Law, ExpInvertsLogAtHalfATurn) {
  for (int i = 0; i < 50; ++i) {
    const Rigid3 a(Eigen::Quaterniond(Eigen::AngleAxisd(kPi, direction())), direction());
    EXPECT_THAT(Rigid3::exp(a.log()), PoseNear(a, 1e-12, 1e-12));
  }
}

TEST_F(Rigid3Law, LogIsBelowHalfATurnForEitherSignOfTheQuaternion) {
  for (int i = 0; i < 50; ++i) {
    Rigid3 a = pose();
    const Vector6 x = a.log();
    a.rotation.coeffs() *= -1;
    EXPECT_THAT(a.log(), MatrixNear(x, 1e-12));
    EXPECT_LE(x.head<3>().norm(), kPi + 1e-12);
  }
}

TEST_F(Rigid3Law, GroupLawsAndMatrixAgree) {
  for (int i = 0; i < 50; ++i) {
    const Rigid3 a = pose();
    const Rigid3 b = pose();
    const Eigen::Vector3d p = direction();
    EXPECT_THAT(a * a.inverse(), PoseNear(Rigid3(), 1e-14, 1e-14));
    EXPECT_THAT((a * b).matrix(), MatrixNear(Eigen::Matrix4d(a.matrix() * b.matrix()), 1e-12));
    EXPECT_THAT((a * b) * p, MatrixNear(Eigen::Vector3d(a * (b * p)), 1e-12));
    const auto back = Rigid3::from_matrix(a.matrix(), "test");
    ASSERT_THAT(back, IsOk());
    EXPECT_THAT(*back, PoseNear(a, 1e-12, 1e-12));
  }
}

TEST_F(Rigid3Law, AdjointMovesATangentAcrossThePose) {
  for (int i = 0; i < 50; ++i) {
    const Rigid3 a = pose();
    const Vector6 d = tangent();
    EXPECT_THAT(a * Rigid3::exp(d), PoseNear(Rigid3::exp(a.adjoint() * d) * a, 1e-12, 1e-11));
  }
}

TEST_F(Rigid3Law, DifferenceIsTheRightPerturbation) {
  for (int i = 0; i < 50; ++i) {
    const Rigid3 a = pose();
    const Vector6 d = tangent();
    EXPECT_THAT(difference(a, a * Rigid3::exp(d)), MatrixNear(d, 1e-9));
  }
}

TEST_F(Rigid3Law, RightJacobianAgreesWithNumericDerivative) {
  constexpr double kStep = 1e-6;
  for (double angle : kAngles) {
    if (angle > kPi - 1e-3) continue;  // log jumps at pi, so it cannot be differenced there
    const Vector6 x = tangent(angle, 1.5);
    Matrix6 forward;
    Matrix6 inverse;
    for (int i = 0; i < 6; ++i) {
      const Vector6 h = kStep * Vector6::Unit(i);
      forward.col(i) = difference(Rigid3::exp(x - h), Rigid3::exp(x + h)) / (2 * kStep);
      inverse.col(i) =
          ((Rigid3::exp(x) * Rigid3::exp(h)).log() - (Rigid3::exp(x) * Rigid3::exp(-h)).log()) /
          (2 * kStep);
    }
    EXPECT_THAT(right_jacobian(x), MatrixNear(forward, 1e-8)) << "angle " << angle;
    EXPECT_THAT(right_jacobian_inverse(x), MatrixNear(inverse, 1e-8)) << "angle " << angle;
  }
}

TEST_F(Rigid3Law, RightJacobianTimesItsInverseIsOneUpToPi) {
  for (double angle : kAngles) {
    const Vector6 x = tangent(angle, 1.5);
    const Matrix6 one = right_jacobian(x) * right_jacobian_inverse(x);
    EXPECT_THAT(one, MatrixNear(Matrix6(Matrix6::Identity()), 1e-12)) << "angle " << angle;
  }
}

TEST_F(Rigid3Law, CovarianceTransportAgreesWithSampling) {
  const Rigid3 a = pose();
  Matrix6 root = Matrix6::Random() * 0.01;
  const Matrix6 cov = root * root.transpose();
  Matrix6 sampled = Matrix6::Zero();
  constexpr int kSamples = 40000;
  for (int i = 0; i < kSamples; ++i) {
    const Rigid3 b = a * Rigid3::exp(root * noise(1.0));
    const Vector6 left = (b * a.inverse()).log();
    sampled += left * left.transpose() / kSamples;
  }
  const Matrix6 transported = a.covariance_in_target(cov);
  EXPECT_THAT(sampled, MatrixNear(transported, 0.05 * transported.cwiseAbs().maxCoeff()));
}

TEST(Rigid3, ReportsDistances) {
  const Rigid3 a(Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ())), {1, 2, 3});
  const Rigid3 b(Eigen::Quaterniond(Eigen::AngleAxisd(-0.2, Eigen::Vector3d::UnitZ())), {1, 2, 5});
  EXPECT_NEAR(rotation_angle(a, b), 0.5, 1e-12);
  EXPECT_NEAR(translation_distance(a, b), 2, 1e-12);
}

TEST(Rigid3, RefusesMatricesThatAreNoPose) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m(0, 0) = 1.01;
  EXPECT_THAT(Rigid3::from_matrix(m, "left"), FailsWith("left: upper left 3x3"));
  m = Eigen::Vector4d(1, 1, -1, 1).asDiagonal();
  EXPECT_THAT(Rigid3::from_matrix(m, "left"), FailsWith("mirrors"));
  m = Eigen::Matrix4d::Identity();
  m(3, 0) = 1;
  EXPECT_THAT(Rigid3::from_matrix(m, "left"), FailsWith("last row"));
  m = Eigen::Matrix4d::Identity();
  m(1, 3) = std::nan("");
  EXPECT_THAT(Rigid3::from_matrix(m, "left"), FailsWith("not finite"));
}

TEST(RotationBetween, TurnsOneDirectionIntoTheOtherAboutAnAxisAcrossBoth) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const auto vector = [&] {
    return Eigen::Vector3d(normal(random), normal(random), normal(random));
  };
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d from = vector(), to = i < 100 ? vector() : Eigen::Vector3d(-3 * from);
    const Eigen::Quaterniond rotation = rotation_between(from, to);
    EXPECT_NEAR((rotation * from.normalized() - to.normalized()).norm(), 0, 1e-7);
    EXPECT_NEAR(rotation.vec().dot(from.normalized()), 0, 1e-7);
    EXPECT_NEAR(rotation.norm(), 1, 1e-12);
  }
}

}  // namespace
}  // namespace sightline
