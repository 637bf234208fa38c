// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/axis_history.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline {
namespace {

constexpr Duration kApart = std::chrono::microseconds(100);   // nearer ones say nothing of rates
constexpr Duration kFitted = std::chrono::milliseconds(120);  // for the extrapolation
constexpr double kUnit = 0.1;                                 // [s], of the times in the fit
constexpr int kParabola = 5;                                  // readings, at least
constexpr double kTurnsSeen = 0.01;  // [s] until a change shows in what is fitted
constexpr Duration kAttached = std::chrono::milliseconds(300);
constexpr size_t kMaxReadings = 4096;  // 3 s of the fastest heads, with room
constexpr double kSameLens = 0.005;    // of the focal length
constexpr double kMoved = 1e-6;        // [rad]

bool is_number(const AxisReading& r) {
  return std::isfinite(r.pan) && std::isfinite(r.tilt) && std::isfinite(r.zoom) &&
         std::max(std::abs(r.pan), std::abs(r.tilt)) < 1e4;
}

}  // namespace

std::string_view to_string(AxesState state) {
  switch (state) {
    case AxesState::kKnown:
      return "known";
    case AxesState::kSilent:
      return "silent";
    case AxesState::kFrozen:
      return "frozen";
    case AxesState::kUnsettled:
      return "unsettled";
    case AxesState::kZoomed:
      return "zoomed";
  }
  return "";
}

// Slack for rounding and for stamps that jitter: a reading may be late by some milliseconds.
bool AxisHistory::follows(const AxisReading& reading) const {
  const AxisReading& last = readings_.back();
  const Duration step = reading.stamp - last.stamp;
  if (step > kGap) return false;
  const double reach = axes_.max_rate * (to_seconds(step) + 0.02) + 4 * axes_.sigma;
  return std::abs(reading.pan - last.pan) <= reach && std::abs(reading.tilt - last.tilt) <= reach;
}

void AxisHistory::add(const AxisReading& reading) {
  if (!is_number(reading)) return;
  std::lock_guard lock(mutex_);
  if (!readings_.empty() && reading.stamp == readings_.back().stamp) return;
  const bool backwards = !readings_.empty() && reading.stamp < readings_.back().stamp;
  if (!readings_.empty() && (backwards || !follows(reading))) {
    readings_.clear();
    settled_ = 0;
  }
  const bool moved = readings_.empty() || std::abs(reading.pan - readings_.back().pan) > kMoved ||
                     std::abs(reading.tilt - readings_.back().tilt) > kMoved;
  // A head that stands is told to turn: it has its time from then on.
  if (moved || !reading.moving) moved_ = reading.stamp;
  readings_.push_back(reading);
  settled_ = std::min(settled_ + 1, kSettled);
  while (readings_.size() > kMaxReadings || reading.stamp - readings_.front().stamp > kKept) {
    readings_.pop_front();
  }
}

void AxisHistory::clear() {
  std::lock_guard lock(mutex_);
  readings_.clear();
  settled_ = 0;
}

AxesState AxisHistory::state(double ahead_s) const {
  if (readings_.empty() || ahead_s > axes_.stale_s) return AxesState::kSilent;
  if (settled_ < kSettled) return AxesState::kUnsettled;
  const AxisReading& newest = readings_.back();
  if (newest.moving && newest.stamp - moved_ > kFrozenAfter) return AxesState::kFrozen;
  if (axes_.zoom.empty()) return AxesState::kKnown;
  const double fx = axes_.lens_at(newest.zoom).fx;
  return std::abs(fx / fx_ - 1) > kSameLens ? AxesState::kZoomed : AxesState::kKnown;
}

// Least squares through the newest 0.12 s: a difference of two rounded readings would give a rate
// that is off by degrees a second. A parabola where there are enough of them, because a head that
// swings is a third of a degree off its tangent 30 ms later.
AxisHistory::Curve AxisHistory::fit() const {
  const AxisReading& newest = readings_.back();
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 2> right = Eigen::Matrix<double, 3, 2>::Zero();
  int count = 0;
  for (auto r = readings_.rbegin(); r != readings_.rend(); ++r, ++count) {
    if (newest.stamp - r->stamp > kFitted) break;
    if (r != readings_.rbegin() && (r - 1)->stamp - r->stamp < kApart) continue;
    const double t = to_seconds(r->stamp - newest.stamp) / kUnit;
    const Eigen::Vector3d powers(1, t, t * t);
    normal += powers * powers.transpose();
    right += powers * Eigen::RowVector2d(r->pan - newest.pan, r->tilt - newest.tilt);
  }
  const int order = count >= kParabola ? 3 : count >= 2 ? 2 : 1;
  Curve curve;
  curve.covariance.topLeftCorner(order, order) =
      axes_.sigma * axes_.sigma * normal.topLeftCorner(order, order).inverse();
  curve.coefficients.topRows(order) =
      normal.topLeftCorner(order, order).ldlt().solve(right.topRows(order));
  curve.coefficients.row(0) += Eigen::RowVector2d(newest.pan, newest.tilt);
  // What is not fitted may be as large as it can.
  if (order < 2) curve.covariance(1, 1) = std::pow(axes_.max_rate * kUnit, 2);
  return curve;
}

// A turn that bends by a constant acceleration leaves the chord by a dt^2 / 8 at most.
void AxisHistory::interpolate(Time stamp, AxesAt& out) const {
  const auto after = std::lower_bound(readings_.begin(), readings_.end(), stamp,
                                      [](const AxisReading& r, Time t) { return r.stamp < t; });
  if (after == readings_.begin()) {  // before all that is kept
    out.pan = readings_.front().pan;
    out.tilt = readings_.front().tilt;
    out.pan_sigma = to_seconds(readings_.front().stamp - stamp) * axes_.max_rate;
    return;
  }
  const AxisReading &a = *std::prev(after), &b = *after;
  const double step = to_seconds(b.stamp - a.stamp);
  const double share = to_seconds(stamp - a.stamp) / step;
  out.pan = a.pan + share * (b.pan - a.pan);
  out.tilt = a.tilt + share * (b.tilt - a.tilt);
  out.pan_rate = (b.pan - a.pan) / step;
  out.tilt_rate = (b.tilt - a.tilt) / step;
  out.zoom = a.zoom + share * (b.zoom - a.zoom);
  out.pan_sigma = axes_.acceleration * step * step / 8;
}

void AxisHistory::extrapolate(double ahead_s, AxesAt& out) const {
  const Curve curve = fit();
  const double ahead = std::min(ahead_s, axes_.stale_s) / kUnit;
  const Eigen::Vector3d powers(1, ahead, ahead * ahead);
  const Eigen::Vector3d slopes(0, 1 / kUnit, 2 * ahead / kUnit);
  const Eigen::RowVector2d angles = powers.transpose() * curve.coefficients;
  const Eigen::RowVector2d rates = slopes.transpose() * curve.coefficients;
  out.pan = angles(0);
  out.tilt = angles(1);
  out.pan_rate = rates(0);
  out.tilt_rate = rates(1);
  out.zoom = readings_.back().zoom;
  // It may do something else since; and has been doing so for a part of what was fitted.
  const double since = ahead_s + kTurnsSeen;
  out.pan_sigma = std::sqrt(powers.dot(curve.covariance * powers)) +
                  0.5 * axes_.acceleration * ahead_s * since +
                  (ahead_s - kUnit * ahead) * axes_.max_rate;
}

AxesAt AxisHistory::look_up(Time capture) const {
  AxesAt out;
  const Time stamp = capture + from_seconds(axes_.latency_s);
  if (readings_.empty()) {
    out.pan_sigma = out.tilt_sigma = std::numbers::pi;
    return out;
  }
  const double ahead_s = to_seconds(stamp - readings_.back().stamp);
  out.state = state(ahead_s);
  if (ahead_s > 0) {
    extrapolate(ahead_s, out);
  } else {
    interpolate(stamp, out);
    const bool older = stamp < readings_.front().stamp;
    if (older && out.state == AxesState::kKnown) out.state = AxesState::kSilent;
  }
  out.pan *= axes_.pan_scale;
  out.tilt *= axes_.tilt_scale;
  out.pan_rate *= axes_.pan_scale;
  out.tilt_rate *= axes_.tilt_scale;
  // Play is a uniform distribution over the gap.
  const double own = axes_.sigma * axes_.sigma + axes_.backlash * axes_.backlash / 12;
  const double beyond = out.pan_sigma * out.pan_sigma;
  const auto sigma = [&](double rate, double scale) {
    const double late = rate * axes_.latency_sigma_s;
    return std::sqrt(scale * scale * (own + beyond) + late * late);
  };
  out.pan_sigma = std::min(sigma(out.pan_rate, axes_.pan_scale), std::numbers::pi);
  out.tilt_sigma = std::min(sigma(out.tilt_rate, axes_.tilt_scale), std::numbers::pi);
  return out;
}

AxesAt AxisHistory::at(Time capture) const {
  std::lock_guard lock(mutex_);
  return look_up(capture);
}

CameraPlace AxisHistory::place(Time capture) const {
  std::lock_guard lock(mutex_);
  const AxesAt at = look_up(capture);
  CameraPlace place;
  place.world_from_camera = axes_.world_from_camera(at.pan, at.tilt);
  place.state = at.state;
  const auto jacobian = axes_.jacobian(at.pan);
  const Eigen::Vector2d variance(at.pan_sigma * at.pan_sigma, at.tilt_sigma * at.tilt_sigma);
  place.covariance =
      std::make_shared<const Matrix6>(jacobian * variance.asDiagonal() * jacobian.transpose());
  for (const AxisReading& reading : readings_) {
    if (readings_.back().stamp - reading.stamp < kAttached) place.readings.push_back(reading);
  }
  return place;
}

}  // namespace sightline
