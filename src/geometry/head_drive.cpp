// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/head_drive.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline {
namespace {

constexpr Duration kKept = std::chrono::seconds(4);  // of orders
constexpr double kBraking = 0.8;  // of the acceleration: the rest is for what is not foreseen
constexpr double kSlow = 0.01;    // [rad/s]: a target that rests

// To the left and down of the axis; whole turns behind it, too.
Eigen::Vector2d bearing(const Eigen::Vector3d& ray) {
  return {std::atan2(ray.x(), ray.z()), std::atan2(ray.y(), std::hypot(ray.x(), ray.z()))};
}

// The nearest of the same directions.
double next_to(double angle, double near) {
  return near + std::remainder(angle - near, 2 * std::numbers::pi);
}

}  // namespace

std::optional<HeadAngles> aim_head(const CameraAxes& axes, const Eigen::Vector3d& point_in_world,
                                   const Eigen::Vector3d& ray_in_camera, const HeadAngles& near) {
  constexpr int kSteps = 30;
  constexpr double kLargest = 0.5, kSame = 1e-9, kSmall = 1e-6, kNearest = 1e-3;
  const Eigen::Vector2d wanted = bearing(ray_in_camera);
  const auto error = [&](const HeadAngles& at) -> Eigen::Vector2d {
    const Eigen::Vector3d point = axes.world_from_camera(at.x(), at.y()).inverse() * point_in_world;
    if (point.norm() < kNearest) return Eigen::Vector2d::Constant(1e3);
    Eigen::Vector2d e = bearing(point) - wanted;
    e.x() = std::remainder(e.x(), 2 * std::numbers::pi);
    return e;
  };
  HeadAngles at = near;
  for (int i = 0; i < kSteps; ++i) {
    const Eigen::Vector2d e = error(at);
    if (e.norm() < kSame) break;
    Eigen::Matrix2d slope;
    for (int axis = 0; axis < 2; ++axis) {
      slope.col(axis) = (error(at + kSmall * HeadAngles::Unit(axis)) - e) / kSmall;
    }
    HeadAngles step = slope.colPivHouseholderQr().solve(-e);
    if (!step.allFinite()) return std::nullopt;
    if (step.norm() > kLargest) step *= kLargest / step.norm();
    at += step;
  }
  if (error(at).norm() > kSmall) return std::nullopt;
  return HeadAngles(next_to(at.x(), near.x()), next_to(at.y(), near.y()));
}

// Each order is in force until the next, or for kAhead.
double AxisDrive::ordered(Time from, Time to) const {
  double turned = 0;
  for (size_t i = 0; i < log_.size(); ++i) {
    const Time end = i + 1 < log_.size() ? log_[i + 1].time : Time::max();
    const Time last = std::min({end, log_[i].time + from_seconds(kAhead), to});
    const Time first = std::max(log_[i].time, from);
    if (last > first) turned += log_[i].rate * to_seconds(last - first);
  }
  return turned;
}

double AxisDrive::predict(Time now, Time stamp, double angle) const {
  return angle + ordered(stamp - from_seconds(limits_.latency_s), now);
}

double AxisDrive::stopping_place(Time now, Time stamp, double angle) const {
  const double way = rate() * std::abs(rate()) / (2 * kBraking * limits_.acceleration);
  return predict(now, stamp, angle) + way;
}

// The rate from which it stops within `room`, if it is kept for one more step.
double AxisDrive::fastest(double room, double step_s) const {
  if (room <= 0) return 0;
  const double a = kBraking * limits_.acceleration;
  return a * (std::sqrt(step_s * step_s + 2 * room / a) - step_s);
}

double AxisDrive::wanted_rate(double error, double target_rate, double step_s) const {
  const bool rests = std::abs(target_rate) < kSlow;
  if (rests && std::abs(error) < limits_.dead_zone) return 0;
  const double back = std::min(limits_.gain * std::abs(error), fastest(std::abs(error), step_s));
  return std::clamp(target_rate + std::copysign(back, error), -limits_.max_rate, limits_.max_rate);
}

AxisDrive::Order AxisDrive::step(Time now, Time stamp, double angle, double target,
                                 double target_rate) {
  const double low = limits_.low[axis_], high = limits_.high[axis_];
  const double since = log_.empty() ? kAhead : to_seconds(now - log_.back().time);
  const double before = since < kAhead ? this->rate() : 0;
  const double change = limits_.acceleration * std::clamp(since, 0.0, kLongest);
  const double at = predict(now, stamp, angle);
  const double goal = std::clamp(target, low, high);
  if (goal != target) target_rate = 0;
  double rate = wanted_rate(goal - at, target_rate, kLongest);
  rate = std::clamp(rate, -fastest(at - low, kLongest), fastest(high - at, kLongest));
  rate = std::clamp(rate, before - change, before + change);
  while (!log_.empty() && now - log_.front().time > kKept) log_.pop_front();
  log_.push_back({now, rate});
  double place = at + kAhead * rate + rate * std::abs(rate) / (2 * limits_.acceleration);
  // It comes to a target that rests, and is not sent through it.
  const bool rests = std::abs(target_rate) < kSlow;
  if (rests && (rate == 0 || (place - goal) * (at - goal) <= 0)) place = goal;
  return {std::clamp(place, low, high), rate};
}

void AxisDrive::rest(Time now) {
  if (rate() != 0) log_.push_back({now, 0});
}

}  // namespace sightline
