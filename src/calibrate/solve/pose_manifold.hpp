// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ceres/manifold.h>

#include <algorithm>
#include <array>

#include "sightline/geometry/rigid3.hpp"

namespace sightline::calibrate {

/// A pose as Ceres holds it: quaternion x, y, z, w, then the translation.
using PoseBlock = std::array<double, 7>;

inline PoseBlock block_of(const Rigid3& pose) {
  PoseBlock b;
  std::copy_n(pose.rotation.coeffs().data(), 4, b.begin());
  std::copy_n(pose.translation.data(), 3, b.begin() + 4);
  return b;
}

inline Rigid3 pose_of(const double* b) {
  return {Eigen::Quaterniond(b[3], b[0], b[1], b[2]), Eigen::Vector3d(b[4], b[5], b[6])};
}

/// pose [+] d = pose * exp(d). Costs give derivatives by the tangent in its first six columns, so
/// that the derivative of Plus is told as the identity over a row of zeros.
class PoseManifold : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    const PoseBlock b = block_of(pose_of(x) * Rigid3::exp(Eigen::Map<const Vector6>(delta)));
    std::copy(b.begin(), b.end(), x_plus_delta);
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>> j(jacobian);
    j.setZero();
    j.topRows<6>().setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* y_minus_x) const override {
    Eigen::Map<Vector6> out(y_minus_x);
    out = difference(pose_of(x), pose_of(y));
    return true;
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> j(jacobian);
    j.setZero();
    j.leftCols<6>().setIdentity();
    return true;
  }
};

/// Ceres says on stderr when a step fails, which is part of the search and ours to report.
void keep_ceres_quiet();

}  // namespace sightline::calibrate
