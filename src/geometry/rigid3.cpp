// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/rigid3.hpp"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

/// Below this angle the closed forms lose digits to cancellation and their series are used.
constexpr double kSmallAngle = 0.5;

/// Sum of c[i] t^i over alternating reciprocal factorials: 1/n! - t/(n+2)! + t^2/(n+4)! - ...
double alternating_series(int n, double t) {
  double factorial = 1;
  for (int i = 2; i <= n; ++i) factorial *= i;
  double term = 1 / factorial;
  double sum = 0;
  for (int i = n; i < n + 18; i += 2) {
    sum += term;
    term *= -t / ((i + 1.0) * (i + 2.0));
  }
  return sum;
}

/// (1 - cos a)/a^2, (a - sin a)/a^3, (cos a - 1 + a^2/2)/a^4, (sin a - a + a^3/6)/a^5.
double one_minus_cos(double a) {
  return a < kSmallAngle ? alternating_series(2, a * a) : (1 - std::cos(a)) / (a * a);
}
double a_minus_sin(double a) {
  return a < kSmallAngle ? alternating_series(3, a * a) : (a - std::sin(a)) / (a * a * a);
}
double cos_rest(double a) {
  const double a2 = a * a;
  return a < kSmallAngle ? alternating_series(4, a2) : (std::cos(a) - 1 + a2 / 2) / (a2 * a2);
}
double sin_rest(double a) {
  const double a2 = a * a;
  return a < kSmallAngle ? alternating_series(5, a2)
                         : (std::sin(a) - a + a * a2 / 6) / (a2 * a2 * a);
}

/// Left Jacobian of SO(3), Sola eq. 145.
Eigen::Matrix3d left_jacobian_so3(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  const Eigen::Matrix3d k = skew(w);
  return Eigen::Matrix3d::Identity() + one_minus_cos(angle) * k + a_minus_sin(angle) * k * k;
}

/// Its inverse, Sola eq. 146, written with cot(a/2), which stays exact up to a = pi.
Eigen::Matrix3d left_jacobian_inverse_so3(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  const double half = angle / 2;
  // (1 - h cot h) / a^2 = (sin h - h cos h) / (a^2 sin h); for small h the numerator is
  // h^3 (1/2! - 1/3!) - h^5 (1/4! - 1/5!) + ...
  double c = 0;
  if (angle < kSmallAngle) {
    const double t = half * half;
    const double numerator = alternating_series(2, t) - alternating_series(3, t);  // / h^3
    c = numerator / (4 * alternating_series(1, t));
  } else {
    c = (1 - half / std::tan(half)) / (angle * angle);
  }
  const Eigen::Matrix3d k = skew(w);
  return Eigen::Matrix3d::Identity() - 0.5 * k + c * k * k;
}

/// The block of the left Jacobian of SE(3) that couples translation to rotation, Sola eq. 180
/// (Barfoot, "State estimation for robotics", eq. 7.86).
Eigen::Matrix3d coupling_block(const Eigen::Vector3d& rho, const Eigen::Vector3d& theta) {
  const double angle = theta.norm();
  const Eigen::Matrix3d r = skew(rho);
  const Eigen::Matrix3d k = skew(theta);
  const Eigen::Matrix3d kr = k * r;
  const Eigen::Matrix3d rk = r * k;
  const Eigen::Matrix3d krk = kr * k;
  return 0.5 * r + a_minus_sin(angle) * (kr + rk + krk) +
         cos_rest(angle) * (k * kr + rk * k - 3 * krk) +
         0.5 * (cos_rest(angle) - 3 * sin_rest(angle)) * (krk * k + k * krk);
}

Vector6 joined(const Eigen::Vector3d& rotation, const Eigen::Vector3d& translation) {
  Vector6 v;
  v << rotation, translation;
  return v;
}

Eigen::Quaterniond exp_so3(const Eigen::Vector3d& w) {
  const double half = w.norm() / 2;
  const double sinc = half < kSmallAngle ? alternating_series(1, half * half)
                                         : std::sin(half) / half;  // sin(h) / h
  const Eigen::Vector3d v = 0.5 * sinc * w;
  return Eigen::Quaterniond(std::cos(half), v.x(), v.y(), v.z());
}

Eigen::Vector3d log_so3(const Eigen::Quaterniond& q) {
  const double sign = q.w() < 0 ? -1.0 : 1.0;
  const Eigen::Vector3d v = sign * q.vec();
  const double n = v.norm();
  if (n < 1e-10) return 2 * v;  // atan2(n, w) / n -> 1 to the last digit
  return (2 * std::atan2(n, sign * q.w()) / n) * v;
}

}  // namespace

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Result<Rigid3> Rigid3::from_matrix(const Eigen::Matrix4d& matrix, const std::string& where) {
  constexpr double kTolerance = 1e-4;
  if (!matrix.allFinite()) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "pose matrix has an entry that is not finite");
  }
  const Eigen::RowVector4d last = matrix.row(3);
  if ((last - Eigen::RowVector4d(0, 0, 0, 1)).cwiseAbs().maxCoeff() > 1e-9) {
    return make_error(
        ErrorCode::kInvalidInput, where,
        "last row of the pose matrix is {} {} {} {}, it must be 0 0 0 1 (is the matrix "
        "transposed?)",
        last(0), last(1), last(2), last(3));
  }
  const Eigen::Matrix3d r = matrix.topLeftCorner<3, 3>();
  const double off = (r * r.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (off > kTolerance) {
    return make_error(
        ErrorCode::kInvalidInput, where,
        "upper left 3x3 of the pose matrix is not a rotation: off orthonormal by {:.3g} "
        "(limit {}); it may be scaled or rounded too coarsely",
        off, kTolerance);
  }
  if (r.determinant() < 0) {
    return make_error(
        ErrorCode::kInvalidInput, where,
        "upper left 3x3 of the pose matrix mirrors (determinant -1); flip one axis to "
        "make it a rotation");
  }
  return Rigid3(Eigen::Quaterniond(r), matrix.topRightCorner<3, 1>());
}

Rigid3 Rigid3::exp(const Vector6& tangent) {
  const Eigen::Vector3d w = tangent.head<3>();
  return Rigid3(exp_so3(w), left_jacobian_so3(w) * tangent.tail<3>());
}

Vector6 Rigid3::log() const {
  const Eigen::Vector3d w = log_so3(rotation);
  return joined(w, left_jacobian_inverse_so3(w) * translation);
}

Rigid3 Rigid3::inverse() const {
  const Eigen::Quaterniond q = rotation.conjugate();
  return Rigid3(q, -(q * translation));
}

Rigid3 Rigid3::operator*(const Rigid3& other) const {
  return Rigid3(rotation * other.rotation, rotation * other.translation + translation);
}

Eigen::Vector3d Rigid3::operator*(const Eigen::Vector3d& point_in_source) const {
  return rotation * point_in_source + translation;
}

Eigen::Matrix4d Rigid3::matrix() const {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = rotation_matrix();
  m.topRightCorner<3, 1>() = translation;
  return m;
}

Matrix6 Rigid3::adjoint() const {
  const Eigen::Matrix3d r = rotation_matrix();
  Matrix6 a = Matrix6::Zero();
  a.topLeftCorner<3, 3>() = r;
  a.bottomRightCorner<3, 3>() = r;
  a.bottomLeftCorner<3, 3>() = skew(translation) * r;
  return a;
}

Matrix6 Rigid3::covariance_in_target(const Matrix6& cov) const {
  const Matrix6 a = adjoint();
  return a * cov * a.transpose();
}

Vector6 difference(const Rigid3& from, const Rigid3& to) { return (from.inverse() * to).log(); }

Matrix6 right_jacobian(const Vector6& x) {
  const Eigen::Vector3d w = -x.head<3>();
  const Eigen::Matrix3d j = left_jacobian_so3(w);
  Matrix6 m = Matrix6::Zero();
  m.topLeftCorner<3, 3>() = j;
  m.bottomRightCorner<3, 3>() = j;
  m.bottomLeftCorner<3, 3>() = coupling_block(-x.tail<3>(), w);
  return m;
}

Matrix6 right_jacobian_inverse(const Vector6& x) {
  const Eigen::Vector3d w = -x.head<3>();
  const Eigen::Matrix3d j = left_jacobian_inverse_so3(w);
  Matrix6 m = Matrix6::Zero();
  m.topLeftCorner<3, 3>() = j;
  m.bottomRightCorner<3, 3>() = j;
  m.bottomLeftCorner<3, 3>() = -j * coupling_block(-x.tail<3>(), w) * j;
  return m;
}

double rotation_angle(const Rigid3& a, const Rigid3& b) {
  const Eigen::Quaterniond q = a.rotation.conjugate() * b.rotation;
  return 2 * std::atan2(q.vec().norm(), std::abs(q.w()));
}

double translation_distance(const Rigid3& a, const Rigid3& b) {
  return (a.translation - b.translation).norm();
}

}  // namespace sightline
