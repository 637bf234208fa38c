// SPDX-License-Identifier: Apache-2.0
#include "observe/shape/revolved_surface.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

namespace sightline::observe {
namespace {

constexpr int kFits = 8;
constexpr size_t kEveryView = 4;
constexpr double kFitScale = 0.02;  // of the radius: what is off by more does not belong to it
constexpr int kSectors = 16;        // of the way around
constexpr int kAllAround = 13;      // sectors in which the surface is found
constexpr double kOnAxis = 0.03;    // of the radius
constexpr double kMostTurn = 0.2;   // [rad] views are less than this apart
constexpr double kMostAcross =
    0.15;  // of a normal along the tangent: seen at the limb of another part

}  // namespace

std::optional<RevolvedSurface> RevolvedSurface::of(const ViewpointModel& views) {
  const auto& axis = views.symmetry_axis() ? views.symmetry_axis() : views.near_axis();
  if (!axis) return std::nullopt;
  return RevolvedSurface(views, *axis);
}

RevolvedSurface::RevolvedSurface(const ViewpointModel& views, const ShapeSymmetry::Axis& about)
    : axis_(about),
      center_(views.center()),
      radius_(views.radius()),
      revolved_(kRadial * kAxial, false) {
  fit_axis(views);
  find_profile(views);
}

void RevolvedSurface::fit_axis(const ViewpointModel& views) {
  for (int fit = 0; fit < kFits; ++fit) {
    Eigen::Matrix<double, 6, 6> moments = Eigen::Matrix<double, 6, 6>::Zero();
    for (size_t i = 0; i < views.size(); i += kEveryView) {
      for (const ContourSample& sample : views.view(i).contour) {
        if (sample.crease != 0) continue;
        const Eigen::Vector3d p = (sample.point.cast<double>() - center_) / radius_;
        const Eigen::Vector3d n = sample.normal.cast<double>();
        const Eigen::Vector3d from_axis = p - (axis_.point - center_) / radius_;
        const double off = n.dot(axis_.direction.cross(from_axis)) / kFitScale;
        Eigen::Matrix<double, 6, 1> row;
        row << p.cross(n), -n;
        moments += row * row.transpose() / std::pow(1 + off * off, 2);
      }
    }
    const Eigen::Matrix3d cross = moments.topRightCorner<3, 3>();
    Eigen::Matrix3d own = moments.bottomRightCorner<3, 3>();
    own.diagonal().array() += 1e-9 * (1 + own.trace());
    const Eigen::Matrix3d gain = own.ldlt().solve(cross.transpose());
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(moments.topLeftCorner<3, 3>() -
                                                                cross * gain);
    Eigen::Vector3d direction = solver.eigenvectors().col(0);
    if (direction.dot(axis_.direction) < 0) direction = -direction;
    if (direction.dot(axis_.direction) < std::cos(kMostTurn)) return;  // it shows too little of it
    const Eigen::Vector3d moment = -gain * direction;                  // a x c
    axis_.direction = direction;
    axis_.point = center_ + radius_ * moment.cross(direction);
  }
}

size_t RevolvedSurface::cell(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d from = (point - axis_.point) / radius_;
  const double along = axis_.direction.dot(point - center_) / radius_;
  const double out = (from - axis_.direction.dot(from) * axis_.direction).norm();
  const double x = out / 1.25 * kRadial, y = 0.5 * (along / 1.1 + 1) * kAxial;
  if (!(x < kRadial) || !(y >= 0 && y < kAxial)) return kRadial * kAxial;
  return static_cast<size_t>(y) * kRadial + static_cast<size_t>(x);
}

void RevolvedSurface::find_profile(const ViewpointModel& views) {
  std::vector<uint32_t> sectors(revolved_.size(), 0);
  const Eigen::Vector3d zero = axis_.direction.unitOrthogonal();
  const Eigen::Vector3d quarter = axis_.direction.cross(zero);
  const auto note = [&](const Eigen::Vector3f& at) {
    const Eigen::Vector3d point = at.cast<double>();
    const size_t i = cell(point);
    if (i >= sectors.size()) return;
    const Eigen::Vector3d from = point - axis_.point;
    const double turn = std::atan2(from.dot(quarter), from.dot(zero)) / (2 * std::numbers::pi);
    sectors[i] |= 1U << static_cast<int>(std::floor((turn + 1) * kSectors)) % kSectors;
  };
  for (size_t i = 0; i < views.size(); ++i) {
    for (const ContourSample& sample : views.view(i).contour) note(sample.point);
    for (const InnerEdgeSample& sample : views.view(i).edges) note(sample.point);
  }
  // A surface that passes between two cells is in either.
  for (size_t i = 0; i < sectors.size(); ++i) {
    uint32_t around = sectors[i];
    const size_t x = i % kRadial, y = i / kRadial;
    if (x > 0) around |= sectors[i - 1];
    if (x + 1 < kRadial) around |= sectors[i + 1];
    if (y > 0) around |= sectors[i - kRadial];
    if (y + 1 < kAxial) around |= sectors[i + kRadial];
    revolved_[i] = std::popcount(around) >= kAllAround;
  }
}

bool RevolvedSurface::contains(const Eigen::Vector3d& point) const {
  const size_t i = cell(point);
  return i < revolved_.size() && revolved_[i];
}

Eigen::Vector3d RevolvedSurface::tangent(const Eigen::Vector3d& point) const {
  return axis_.direction.cross(point - axis_.point).normalized();
}

std::optional<RevolvedSurface::LimbPoint> RevolvedSurface::limb(
    const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
    const Eigen::Vector3d& camera) const {
  const Eigen::Vector3d& a = axis_.direction;
  const Eigen::Vector3d p = point - axis_.point, c = camera - axis_.point;
  const Eigen::Vector3d out = p - a.dot(p) * a;
  if (out.norm() < kOnAxis * radius_) return std::nullopt;
  const Eigen::Vector3d tangent = a.cross(out).normalized();
  if (std::abs(normal.dot(tangent)) > kMostAcross) return std::nullopt;
  const Eigen::Vector3d n = (normal - normal.dot(tangent) * tangent).normalized();
  // n . p does not change with the turn; (R n) . c does, as a cosine.
  const Eigen::Vector3d side = n - a.dot(n) * a;
  const double length = side.norm();
  if (length < 1e-6) return std::nullopt;
  const double level = a.dot(n) * a.dot(c);
  const double x = side.dot(c), y = a.cross(side).dot(c);  // x cos + y sin = n . p - level
  const double reach = std::hypot(x, y), wanted = n.dot(p) - level;
  if (!(reach > 0) || std::abs(wanted) > reach) return std::nullopt;
  const double peak = std::atan2(y, x), off = std::acos(wanted / reach);
  const auto wrapped = [](double angle) { return std::remainder(angle, 2 * std::numbers::pi); };
  const double first = wrapped(peak + off), second = wrapped(peak - off);
  const double turn = std::abs(first) < std::abs(second) ? first : second;
  if (std::abs(turn) > kMostTurn) return std::nullopt;
  const Eigen::Matrix3d rotation = Eigen::AngleAxisd(turn, a).toRotationMatrix();
  return LimbPoint{axis_.point + rotation * p, rotation * n};
}

}  // namespace sightline::observe
