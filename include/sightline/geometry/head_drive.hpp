// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <deque>
#include <optional>

#include "sightline/base/time.hpp"
#include "sightline/geometry/camera_axes.hpp"

namespace sightline {

/// Pan and tilt of a head [rad] or their rates [rad/s], scaled: as CameraAxes turns by them.
using HeadAngles = Eigen::Vector2d;

/// The angles, next to `near`, at which the ray `ray_in_camera` (unit, z > 0) of a camera on a head
/// points at a point. Empty: none were found, as for a point on the pan axis. Gauss-Newton.
std::optional<HeadAngles> aim_head(const CameraAxes& axes, const Eigen::Vector3d& point_in_world,
                                   const Eigen::Vector3d& ray_in_camera, const HeadAngles& near);

/// What a head may be ordered to do. The same for both axes but for the range.
struct HeadLimits {
  HeadAngles low{-2.9, -0.5}, high{2.9, 1.5};
  double max_rate = 1.0;      ///< [rad/s]
  double acceleration = 2.0;  ///< [rad/s^2]
  double gain = 3;            ///< [1/s]: rate by which an error is made good
  double latency_s = 0.1;     ///< from an order until the head does it
  double dead_zone = 0.003;   ///< errors below are left

  bool operator==(const HeadLimits& other) const = default;
};

/// What the head is to do until the next order: go to a place at a rate. The place lies where the
/// head comes within kAhead and a full stop, within its range, so that a head that hears no more
/// stops by itself.
struct HeadOrder {
  HeadAngles place = HeadAngles::Zero();  ///< [rad]
  HeadAngles rate = HeadAngles::Zero();   ///< [rad/s], with its sign
};

/// Drives one axis to a moving target. The head answers late, so the error is that of the angle at
/// which the order will find it: the newest angle measured, and what has been ordered since (a
/// Smith predictor of a head that does as it is told; O. Smith, 1957). Rates of orders never exceed
/// max_rate, differ from one to the next by no more than `acceleration` allows, and leave room to
/// stop within the range. One thread at a time.
class AxisDrive {
 public:
  AxisDrive(const HeadLimits& limits, int axis) : limits_(limits), axis_(axis) {}

  struct Order {
    double place = 0, rate = 0;
  };
  /// `angle` was measured at `stamp`; `target` and its rate are those at now + latency_s.
  Order step(Time now, Time stamp, double angle, double target, double target_rate);
  /// The angle that an order of now finds.
  double predict(Time now, Time stamp, double angle) const;
  /// Where it stands if it is stopped gently from now on.
  double stopping_place(Time now, Time stamp, double angle) const;
  /// By how much the orders that were in force between two times turn it [rad].
  double ordered(Time from, Time to) const;
  /// Of the last order; 0 before.
  double rate() const { return log_.empty() ? 0 : log_.back().rate; }
  /// Nothing is ordered any more: what is in force ends by itself.
  void rest(Time now);

  static constexpr double kAhead = 0.3;    ///< [s] for which an order without a next one goes on
  static constexpr double kLongest = 0.1;  ///< [s] between orders while it turns

 private:
  struct Sent {
    Time time;
    double rate;
  };
  double wanted_rate(double error, double target_rate, double step_s) const;
  double fastest(double room, double step_s) const;

  HeadLimits limits_;
  int axis_;
  std::deque<Sent> log_;
};

}  // namespace sightline
