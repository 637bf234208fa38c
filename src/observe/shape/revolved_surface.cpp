// SPDX-License-Identifier: Apache-2.0
#include "observe/shape/revolved_surface.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>

namespace sightline::observe {
namespace {

constexpr int kFits = 8;
constexpr size_t kEveryView = 2;
constexpr double kFirstScale = 0.1,
                 kLastScale = 0.01;  // [radii] what is off by more is no part of it
constexpr double kMostStep = 0.5;    // [radii, rad]
constexpr double kMostSteep = 0.3;   // of a normal along the axis
constexpr double kReach = 2.0;       // [radii] along the axis
constexpr int kSectors = 16;         // of the way around
constexpr int kAllAround = 13;       // sectors in which the surface is found
constexpr double kOnAxis = 0.03;     // of the radius
constexpr double kMostTurn = 0.5;    // [rad] between views, and from inside the outline to the limb
// Samples are taken up to a pixel inside the outline of a view, where a curved surface is well in
// front of its limb: so near is the limb to the axis, as a share of the sample's distance.
constexpr double kLeastDistance = 0.88;
constexpr double kLeastSide = 0.05;  // of a normal across the axis: a lid has no limb

}  // namespace

Eigen::Vector3d limb_normal(const View& view, const ContourSample& sample) {
  const Eigen::Vector3d normal = sample.normal.cast<double>();
  const Eigen::Vector3d camera = view.camera_from_object.inverse().translation;
  const Eigen::Vector3d sight = (sample.point.cast<double>() - camera).normalized();
  return (normal - normal.dot(sight) * sight).normalized();
}

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

// Medians: a handle is a part of the outline at few turns.
std::array<double, RevolvedSurface::kAxial> RevolvedSurface::profile_of(
    const std::vector<TangentLine>& lines) {
  std::array<std::vector<double>, kAxial> distances;
  for (const TangentLine& line : lines) distances[line.cell].push_back(line.distance);
  std::array<double, kAxial> out{};
  for (size_t k = 0; k < kAxial; ++k) {
    std::vector<double>& all = distances[k];
    if (all.empty()) continue;
    const auto middle = all.begin() + static_cast<ptrdiff_t>(all.size() / 2);
    std::nth_element(all.begin(), middle, all.end());
    out[k] = *middle;
  }
  return out;
}

void RevolvedSurface::fit_axis(const ViewpointModel& views) {
  std::vector<TangentLine> lines;
  double scale = kFirstScale;
  for (int fit = 0; fit < kFits; ++fit, scale = std::max(kLastScale, 0.6 * scale)) {
    const Eigen::Vector3d e1 = axis_.direction.unitOrthogonal();
    const Eigen::Vector3d e2 = axis_.direction.cross(e1);
    collect(views, e1, e2, lines);
    const std::array<double, kAxial> radius = profile_of(lines);
    Eigen::Matrix<double, 5, 5> moments = Eigen::Matrix<double, 5, 5>::Zero();
    for (const TangentLine& line : lines) {
      const double off = line.distance - radius[line.cell];
      Eigen::Matrix<double, 5, 1> row;
      row << line.normal, line.along * line.normal, off;
      moments += row * row.transpose() / std::pow(1 + off * off / (scale * scale), 2);
    }
    moments.diagonal().head<4>().array() += 1e-9 * (1 + moments.trace());
    const Eigen::Vector4d step =
        moments.topLeftCorner<4, 4>().ldlt().solve(moments.topRightCorner<4, 1>());
    if (!(step.norm() < kMostStep)) return;  // it shows too little of it
    axis_.point += radius_ * (step[0] * e1 + step[1] * e2);
    axis_.direction = (axis_.direction + step[2] * e1 + step[3] * e2).normalized();
  }
}

// Samples lie up to a pixel inside the outline, well in front of the limb, but the tangent plane
// there is seen edge-on: its distance from the axis is exact.
void RevolvedSurface::collect(const ViewpointModel& views, const Eigen::Vector3d& e1,
                              const Eigen::Vector3d& e2, std::vector<TangentLine>& lines) const {
  lines.clear();
  for (size_t i = 0; i < views.size(); i += kEveryView) {
    const View view = views.view(i);
    for (const ContourSample& sample : view.contour) {
      if (sample.crease != 0) continue;
      const Eigen::Vector3d n = limb_normal(view, sample);
      const double steep = n.dot(axis_.direction);
      if (std::abs(steep) > kMostSteep) continue;
      const Eigen::Vector3d p = (sample.point.cast<double>() - axis_.point) / radius_;
      const double side = std::sqrt(1 - steep * steep), along = p.dot(axis_.direction);
      const double row = 0.5 * (along / kReach + 1) * kAxial;
      if (!(row >= 0 && row < kAxial)) continue;
      lines.push_back({Eigen::Vector2d(n.dot(e1), n.dot(e2)) / side,
                       (n.dot(p) - steep * along) / side, along, static_cast<size_t>(row)});
    }
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
  const Eigen::Vector3d from_axis = point - axis_.point, c = camera - axis_.point;
  const double along = a.dot(from_axis), steep = a.dot(normal);
  const Eigen::Vector3d out = from_axis - along * a, side = normal - steep * a;
  const double length = side.norm();
  if (out.norm() < kOnAxis * radius_ || length < kLeastSide) return std::nullopt;
  // Where the tangent plane that the sample lies in touches the surface.
  const Eigen::Vector3d n = normal;
  const double distance = out.dot(side) / length;
  if (distance < kLeastDistance * out.norm()) return std::nullopt;
  const Eigen::Vector3d p = along * a + distance / length * side;
  // n . p does not change with the turn; (R n) . c does, as a cosine.
  const double level = steep * a.dot(c);
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
