// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "sightline/base/result.hpp"

namespace sightline {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// Skew-symmetric matrix: skew(a) * b = a x b.
Eigen::Matrix3d skew(const Eigen::Vector3d& v);

/// A rigid transform, written target_from_source:  x_target = rotation * x_source + translation.
///
/// Tangent order is (rotation [rad], translation [m]), perturbed on the right (source side):
///     pose [+] d  =  pose * exp(d)
/// so for world_from_object a tangent vector is expressed in the object's frame. All Jacobians,
/// information matrices and covariances of poses in this project follow this rule.
/// Formulas: Sola, Deray, Atchuthan, "A micro Lie theory", 2018, appendix D.
struct Rigid3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Rigid3() = default;
  /// Normalizes `q`.
  Rigid3(const Eigen::Quaterniond& q, const Eigen::Vector3d& t)
      : rotation(q.normalized()), translation(t) {}

  /// From a 4x4 matrix; refused unless the rotation is orthonormal to 1e-4 with determinant +1,
  /// the last row is 0 0 0 1 and all entries are finite. `where` goes into the error.
  static Result<Rigid3> from_matrix(const Eigen::Matrix4d& matrix, const std::string& where);

  /// Exponential of a tangent vector, and its inverse (rotation angle below pi).
  static Rigid3 exp(const Vector6& tangent);
  Vector6 log() const;

  Rigid3 inverse() const;
  Rigid3 operator*(const Rigid3& other) const;
  Eigen::Vector3d operator*(const Eigen::Vector3d& point_in_source) const;
  Eigen::Matrix4d matrix() const;
  Eigen::Matrix3d rotation_matrix() const { return rotation.toRotationMatrix(); }

  /// Exactly the same numbers.
  friend bool operator==(const Rigid3& a, const Rigid3& b) {
    return a.rotation.coeffs() == b.rotation.coeffs() && a.translation == b.translation;
  }

  /// (*this) * exp(d) = exp(adjoint() * d) * (*this)
  Matrix6 adjoint() const;
  /// Covariance of the same uncertainty perturbed on the left (target side): Ad * cov * Ad^T.
  Matrix6 covariance_in_target(const Matrix6& cov) const;
};

/// Tangent d with  from * exp(d) = to.
Vector6 difference(const Rigid3& from, const Rigid3& to);

/// Inverse of the right Jacobian of SE(3): log(exp(x) exp(d)) = x + right_jacobian_inverse(x) d.
Matrix6 right_jacobian_inverse(const Vector6& x);
/// Right Jacobian of SE(3): exp(x + d) = exp(x) exp(right_jacobian(x) d).
Matrix6 right_jacobian(const Vector6& x);

/// Angle of the rotation between two poses [rad] and distance of their origins [m].
double rotation_angle(const Rigid3& a, const Rigid3& b);
double translation_distance(const Rigid3& a, const Rigid3& b);

}  // namespace sightline
