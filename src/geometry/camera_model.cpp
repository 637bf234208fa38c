// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/camera_model.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "geometry/lens_polynomial.hpp"

namespace sightline {

using namespace geometry;

namespace {

/// Normalized radius searched for a fold: 89.99 degrees off the axis. A pinhole lens that grows up
/// to here is taken to grow for ever.
constexpr double kPinholeLimit = 1e4;
/// Rays are made up to this part of the fold-over radius.
constexpr double kInsideFold = 1 - 1e-9;

RadialProfile radial_profile(const CameraModel::Parameters& p) {
  const std::array<double, 8>& k = p.distortion;
  RadialProfile profile;
  if (p.lens == LensModel::kFisheye) {
    profile.numerator = {1, k[0], k[1], k[2], k[3]};
    return profile;
  }
  profile.numerator = {1, k[0], k[1], k[4], 0};
  if (p.lens == LensModel::kRational) profile.denominator = {1, k[5], k[6], k[7]};
  return profile;
}

double max_radius(const CameraModel::Parameters& p) {
  if (p.lens == LensModel::kFisheye) return fold_over_radius(radial_profile(p), std::numbers::pi);
  const double r = fold_over_radius(radial_profile(p), kPinholeLimit);
  return r < kPinholeLimit ? r : std::numeric_limits<double>::infinity();
}

size_t coefficient_count(LensModel lens) {
  switch (lens) {
    case LensModel::kBrownConrady:
      return 5;
    case LensModel::kRational:
      return 8;
    case LensModel::kFisheye:
      return 4;
  }
  return 0;
}

/// Pinhole distortion of a normalized point, OpenCV's projectPoints, with its 2x2 derivative.
Eigen::Vector2d distort(const CameraModel::Parameters& p, const Eigen::Vector2d& m,
                        Eigen::Matrix2d* derivative) {
  const std::array<double, 8>& k = p.distortion;
  const double x = m.x();
  const double y = m.y();
  const double u = x * x + y * y;
  const double numerator = 1 + u * (k[0] + u * (k[1] + u * k[4]));
  const bool rational = p.lens == LensModel::kRational;
  const double over = rational ? 1 / (1 + u * (k[5] + u * (k[6] + u * k[7]))) : 1.0;
  const double radial = numerator * over;
  const double p1 = k[2];
  const double p2 = k[3];
  if (derivative != nullptr) {
    double slope = k[0] + u * (2 * k[1] + u * 3 * k[4]);  // d(radial)/du
    if (rational) slope = (slope - radial * (k[5] + u * (2 * k[6] + u * 3 * k[7]))) * over;
    const double cross = 2 * (slope * x * y + p1 * x + p2 * y);
    *derivative << radial + 2 * slope * x * x + 2 * p1 * y + 6 * p2 * x, cross, cross,
        radial + 2 * slope * y * y + 6 * p1 * y + 2 * p2 * x;
  }
  return {x * radial + 2 * p1 * x * y + p2 * (u + 2 * x * x),
          y * radial + p1 * (u + 2 * y * y) + 2 * p2 * x * y};
}

/// Distorted normalized point of a fisheye with its 2x3 derivative by the point; no value for a
/// point straight behind or beyond `max_angle`.
std::optional<Eigen::Vector2d> distort_fisheye(const CameraModel::Parameters& p, double max_angle,
                                               const Eigen::Vector3d& point,
                                               Eigen::Matrix<double, 2, 3>* derivative) {
  const double rho = std::hypot(point.x(), point.y());
  const double angle = std::atan2(rho, point.z());
  if (!(angle <= max_angle)) return std::nullopt;
  if (rho <= 0 && !(point.z() > 0)) return std::nullopt;
  const std::array<double, 8>& k = p.distortion;
  const double u = angle * angle;
  const double theta_d = angle * (1 + u * (k[0] + u * (k[1] + u * (k[2] + u * k[3]))));
  const Eigen::Vector2d across = point.head<2>();
  const bool on_axis = rho < 1e-12 * point.z();
  const double scale = on_axis ? 1 / point.z() : theta_d / rho;
  if (derivative != nullptr) {
    const double slope = 1 + u * (3 * k[0] + u * (5 * k[1] + u * (7 * k[2] + u * 9 * k[3])));
    const double d2 = point.squaredNorm();
    const Eigen::Vector2d n = on_axis ? Eigen::Vector2d(1, 0) : Eigen::Vector2d(across / rho);
    derivative->leftCols<2>() = scale * Eigen::Matrix2d::Identity();
    derivative->leftCols<2>() += (slope * point.z() / d2 - scale) * n * n.transpose();
    derivative->col(2) = -(slope * rho / d2) * n;
  }
  return scale * across;
}

/// Normalized point whose distortion is `target`: the radial part inverted roughly, but safely,
/// then Newton through all of it, kept inside the fold.
std::optional<Eigen::Vector2d> undistort(const CameraModel::Parameters& p, double max_radius,
                                         const Eigen::Vector2d& target) {
  const double limit = std::min(max_radius, kPinholeLimit);
  const double distance = target.norm();
  if (!std::isfinite(distance)) return std::nullopt;
  if (distance == 0 && p.distortion[2] == 0 && p.distortion[3] == 0) return target;
  Eigen::Vector2d m = target;
  if (distance > 0) m *= invert_profile(radial_profile(p), distance, limit, 1e-4) / distance;
  const double tolerance_px = 1e-8;
  for (int i = 0; i < 50; ++i) {
    Eigen::Matrix2d j;
    const Eigen::Vector2d error = distort(p, m, &j) - target;
    const double error_px = std::max(std::abs(error.x()) * p.fx, std::abs(error.y()) * p.fy);
    if (error_px < tolerance_px) {
      // At the fold itself rounding would decide whether the ray projects back.
      return m.norm() < max_radius * kInsideFold ? std::optional(m) : std::nullopt;
    }
    if (!(std::abs(j.determinant()) > 1e-12)) return std::nullopt;
    m -= j.inverse() * error;
    const double r = m.norm();
    if (!std::isfinite(r)) return std::nullopt;
    if (r > limit) m *= limit / r;
  }
  return std::nullopt;
}

/// What no lens has, and numerics do not bear. Of the longer side: a fisheye of 300 degrees has a
/// focal length of 0.2 sides, a field of view of 0.01 degrees one of 6000; a window cut out of a
/// large sensor has the principal point some sides away.
constexpr double kShortestFocal = 0.01, kLongestFocal = 10'000, kFarthestCenter = 100;
/// Lenses of long focal length that were calibrated with too many coefficients have some of 1e6.
constexpr double kLargestCoefficient = 1e12;

std::optional<Error> absurd_center(const CameraModel::Parameters& p, const std::string& where) {
  const double side = std::max(p.width, p.height);
  const double limit = kFarthestCenter * side;
  if (std::abs(p.cx - p.width / 2.0) <= limit && std::abs(p.cy - p.height / 2.0) <= limit) {
    return std::nullopt;  // false for NaN
  }
  return make_error(ErrorCode::kInvalidInput, where,
                    "principal point cx = {}, cy = {} is {} for an image of "
                    "{}x{}; it must be "
                    "within {} px of the middle",
                    p.cx, p.cy, std::isfinite(p.cx + p.cy) ? "absurd" : "not finite", p.width,
                    p.height, limit);
}

std::optional<Error> absurd_focal(const CameraModel::Parameters& p, const std::string& where) {
  const double side = std::max(p.width, p.height);
  const double least = kShortestFocal * side, most = kLongestFocal * side;
  const auto good = [&](double f) { return f >= least && f <= most; };  // false for NaN
  if (good(p.fx) && good(p.fy)) return std::nullopt;
  return make_error(ErrorCode::kInvalidInput, where,
                    "focal lengths fx = {} and fy = {} must be positive "
                    "numbers of pixels, {} to "
                    "{} for an image of {}x{}",
                    p.fx, p.fy, least, most, p.width, p.height);
}

std::optional<Error> first_fault(const CameraModel::Parameters& p, const std::string& where) {
  constexpr int kMaxSize = 32768;
  if (p.width < 1 || p.width > kMaxSize || p.height < 1 || p.height > kMaxSize) {
    return make_error(ErrorCode::kInvalidInput, where, "image size {}x{} is outside 1..{}", p.width,
                      p.height, kMaxSize);
  }
  if (auto fault = absurd_focal(p, where)) return fault;
  if (auto fault = absurd_center(p, where)) return fault;
  const size_t count = coefficient_count(p.lens);
  for (size_t i = 0; i < p.distortion.size(); ++i) {
    if (!std::isfinite(p.distortion[i])) {
      return make_error(ErrorCode::kInvalidInput, where, "distortion coefficient {} is not finite",
                        i + 1);
    }
    if (std::abs(p.distortion[i]) > kLargestCoefficient) {
      return make_error(ErrorCode::kInvalidInput, where,
                        "distortion coefficient {} is {}; no lens has more "
                        "than {} either way",
                        i + 1, p.distortion[i], kLargestCoefficient);
    }
    if (i >= count && p.distortion[i] != 0) {
      return make_error(ErrorCode::kInvalidInput, where,
                        "distortion coefficient {} is set, but this lens model has only {}", i + 1,
                        count);
    }
  }
  return std::nullopt;
}

}  // namespace

Result<CameraModel> CameraModel::create(const Parameters& parameters, const std::string& where) {
  if (auto fault = first_fault(parameters, where)) return *std::move(fault);
  return CameraModel(parameters);
}

CameraModel::CameraModel(const Parameters& parameters)
    : parameters_(parameters), max_valid_radius_(max_radius(parameters)) {}

std::optional<Eigen::Vector2d> CameraModel::project(const Eigen::Vector3d& point_in_camera,
                                                    Eigen::Matrix<double, 2, 3>* jacobian) const {
  const Parameters& p = parameters_;
  Eigen::Vector2d distorted;
  if (p.lens == LensModel::kFisheye) {
    const auto d = distort_fisheye(p, max_valid_radius_, point_in_camera, jacobian);
    if (!d) return std::nullopt;
    distorted = *d;
  } else {
    if (!(point_in_camera.z() > 0)) return std::nullopt;
    const double over_z = 1 / point_in_camera.z();
    const Eigen::Vector2d m = over_z * point_in_camera.head<2>();
    if (!(m.squaredNorm() <= max_valid_radius_ * max_valid_radius_)) return std::nullopt;
    Eigen::Matrix2d d;
    distorted = distort(p, m, jacobian != nullptr ? &d : nullptr);
    if (jacobian != nullptr) {
      jacobian->leftCols<2>() = over_z * d;
      jacobian->col(2) = -over_z * (d * m);
    }
  }
  if (jacobian != nullptr) {
    jacobian->row(0) *= p.fx;
    jacobian->row(1) *= p.fy;
  }
  const Eigen::Vector2d pixel(p.fx * distorted.x() + p.cx, p.fy * distorted.y() + p.cy);
  if (!pixel.allFinite()) return std::nullopt;
  return pixel;
}

std::optional<Eigen::Vector3d> CameraModel::unproject(const Eigen::Vector2d& pixel) const {
  const Parameters& p = parameters_;
  const Eigen::Vector2d target((pixel.x() - p.cx) / p.fx, (pixel.y() - p.cy) / p.fy);
  if (p.lens != LensModel::kFisheye) {
    const auto m = undistort(p, max_valid_radius_, target);
    if (!m) return std::nullopt;
    return Eigen::Vector3d(m->x(), m->y(), 1).normalized();
  }
  const double theta_d = target.norm();
  if (!std::isfinite(theta_d)) return std::nullopt;
  if (theta_d == 0) return Eigen::Vector3d::UnitZ();
  const RadialProfile profile = radial_profile(p);
  const double angle = invert_profile(profile, theta_d, max_valid_radius_, 1e-13);
  const double error = std::abs(profile.distorted(angle) - theta_d);
  if (!(error * std::max(p.fx, p.fy) < 1e-8)) return std::nullopt;
  if (!(angle < max_valid_radius_ * kInsideFold)) return std::nullopt;
  const Eigen::Vector2d across = target * (std::sin(angle) / theta_d);
  return Eigen::Vector3d(across.x(), across.y(), std::cos(angle));
}

bool CameraModel::contains(const Eigen::Vector2d& pixel) const {
  return pixel.x() >= -0.5 && pixel.x() < width() - 0.5 && pixel.y() >= -0.5 &&
         pixel.y() < height() - 0.5;
}

}  // namespace sightline
