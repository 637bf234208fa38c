// SPDX-License-Identifier: Apache-2.0
#include "calibrate/solve/lens_projection.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::calibrate {
namespace {

constexpr double kLeastDepth = 1e-9;  // of a pinhole [m]

/// Distorted normalized coordinates and their derivatives by x/z, y/z and the coefficients
/// (OpenCV, "Camera calibration and 3D reconstruction", the formulas of projectPoints).
struct Distorted {
  Eigen::Vector2d point;
  Eigen::Matrix2d by_xy;
  Eigen::Matrix<double, 2, 8> by_coefficients = Eigen::Matrix<double, 2, 8>::Zero();
};

Distorted distort(const double* k, double x, double y) {
  const double r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2;
  const double above = 1 + k[0] * r2 + k[1] * r4 + k[4] * r6;
  const double below = 1 + k[5] * r2 + k[6] * r4 + k[7] * r6;
  const double radial = above / below;
  // d radial / d r2
  const double slope =
      ((k[0] + 2 * k[1] * r2 + 3 * k[4] * r4) - radial * (k[5] + 2 * k[6] * r2 + 3 * k[7] * r4)) /
      below;
  Distorted d;
  d.point = {x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x),
             y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y};
  d.by_xy << radial + 2 * x * x * slope + 2 * k[2] * y + 6 * k[3] * x,
      2 * x * y * slope + 2 * k[2] * x + 2 * k[3] * y,
      2 * x * y * slope + 2 * k[2] * x + 2 * k[3] * y,
      radial + 2 * y * y * slope + 6 * k[2] * y + 2 * k[3] * x;
  const Eigen::Vector2d p(x, y);
  d.by_coefficients.col(0) = p * (r2 / below);
  d.by_coefficients.col(1) = p * (r4 / below);
  d.by_coefficients.col(2) = Eigen::Vector2d(2 * x * y, r2 + 2 * y * y);
  d.by_coefficients.col(3) = Eigen::Vector2d(r2 + 2 * x * x, 2 * x * y);
  d.by_coefficients.col(4) = p * (r6 / below);
  d.by_coefficients.col(5) = -p * (radial * r2 / below);
  d.by_coefficients.col(6) = -p * (radial * r4 / below);
  d.by_coefficients.col(7) = -p * (radial * r6 / below);
  return d;
}

struct Normalized {
  Eigen::Vector2d point;
  Eigen::Matrix<double, 2, 3> by_point;
  Eigen::Matrix<double, 2, 8> by_coefficients;
};

bool pinhole(const double* k, const Eigen::Vector3d& p, Normalized& out) {
  if (p.z() < kLeastDepth) return false;
  const double x = p.x() / p.z(), y = p.y() / p.z();
  const Distorted d = distort(k, x, y);
  Eigen::Matrix<double, 2, 3> xy;
  xy << 1 / p.z(), 0, -x / p.z(), 0, 1 / p.z(), -y / p.z();
  out = {d.point, d.by_xy * xy, d.by_coefficients};
  return true;
}

bool fisheye(const double* k, const Eigen::Vector3d& p, Normalized& out) {
  const double r = p.head<2>().norm();
  if (r < 1e-9 * p.norm() || p.norm() < kLeastDepth) {
    if (p.z() <= 0) return false;
    out.point = p.head<2>() / p.z();
    out.by_point << 1 / p.z(), 0, 0, 0, 1 / p.z(), 0;
    out.by_coefficients.setZero();
    return true;
  }
  const double theta = std::atan2(r, p.z());
  const double t2 = theta * theta, t4 = t2 * t2, t6 = t4 * t2, t8 = t4 * t4;
  const double angle = theta * (1 + k[0] * t2 + k[1] * t4 + k[2] * t6 + k[3] * t8);
  const double slope = 1 + 3 * k[0] * t2 + 5 * k[1] * t4 + 7 * k[2] * t6 + 9 * k[3] * t8;
  const Eigen::Vector2d u = p.head<2>() / r;
  out.point = angle * u;
  const double n2 = p.squaredNorm();
  Eigen::RowVector3d theta_by_point;
  theta_by_point << p.z() / n2 * u.x(), p.z() / n2 * u.y(), -r / n2;
  out.by_point = slope * u * theta_by_point;
  out.by_point.leftCols<2>() += angle / r * (Eigen::Matrix2d::Identity() - u * u.transpose());
  out.by_coefficients.setZero();
  const double powers[] = {t2, t4, t6, t8};
  for (int i = 0; i < 4; ++i) out.by_coefficients.col(i) = theta * powers[i] * u;
  return true;
}

}  // namespace

int coefficient_count(LensModel lens) {
  return lens == LensModel::kBrownConrady ? 5 : lens == LensModel::kRational ? 8 : 4;
}

LensVector lens_vector(const CameraModel& model) {
  const CameraModel::Parameters& p = model.parameters();
  LensVector v{};
  v[0] = p.fx;
  v[1] = p.fy;
  v[2] = p.cx;
  v[3] = p.cy;
  std::copy(p.distortion.begin(), p.distortion.end(), v.begin() + 4);
  return v;
}

CameraModel::Parameters lens_parameters(LensModel lens, const LensVector& v, int width,
                                        int height) {
  CameraModel::Parameters p;
  p.lens = lens;
  p.width = width;
  p.height = height;
  p.fx = v[0];
  p.fy = v[1];
  p.cx = v[2];
  p.cy = v[3];
  std::copy_n(v.begin() + 4, coefficient_count(lens), p.distortion.begin());
  return p;
}

bool project_lens(LensModel lens, const double* v, const Eigen::Vector3d& point,
                  Eigen::Vector2d& pixel, Eigen::Matrix<double, 2, 3>* by_point,
                  Eigen::Matrix<double, 2, 12>* by_lens) {
  Normalized n;
  if (!(lens == LensModel::kFisheye ? fisheye(v + 4, point, n) : pinhole(v + 4, point, n))) {
    return false;
  }
  const Eigen::Vector2d f(v[0], v[1]);
  pixel = f.cwiseProduct(n.point) + Eigen::Vector2d(v[2], v[3]);
  if (by_point != nullptr) *by_point = f.asDiagonal() * n.by_point;
  if (by_lens != nullptr) {
    by_lens->leftCols<4>() << n.point.x(), 0, 1, 0, 0, n.point.y(), 0, 1;
    by_lens->rightCols<8>() = f.asDiagonal() * n.by_coefficients;
  }
  return pixel.allFinite();
}

}  // namespace sightline::calibrate
