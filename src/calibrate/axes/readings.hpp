// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "sightline/geometry/axis_history.hpp"

namespace sightline::calibrate {

/// What a head's readings say at one time, as the device counts [rad].
struct ReadAngles {
  Eigen::Vector2d angles = Eigen::Vector2d::Zero();  ///< pan, tilt
  Eigen::Vector2d rates = Eigen::Vector2d::Zero();   ///< [rad/s], over a tenth of a second
  double zoom = 0;
};

/// Readings of a whole recording. Times [s] are since an origin of the caller's choice.
class Readings {
 public:
  Readings(const std::vector<AxisReading>& readings, Time origin);

  bool empty() const { return times_.empty(); }
  /// Linear between two readings; empty where none is near.
  std::optional<ReadAngles> at(double time_s) const;
  /// Between these times they all agree to `tolerance` [rad], and there is one at least.
  bool constant(double from_s, double to_s, double tolerance) const;
  /// Mean and scatter (one sigma) of those between these times that are within `tolerance` of their
  /// median; empty if that are fewer than half of them.
  struct Rest {
    Eigen::Vector2d angles, scatter;
    double zoom = 0;
  };
  std::optional<Rest> rest(double from_s, double to_s, double tolerance) const;
  /// From which side each axis came to where it is at that time: 1 if its readings grew, -1 if they
  /// fell, 0 where it has come less than `travel` [rad] since it turned back, or nobody knows.
  std::array<int, 2> sides(double time_s, double travel) const;
  /// Smallest difference of two angles, 0 with fewer than two of them [rad].
  double step() const { return step_; }
  /// White noise of a single reading, one sigma [rad]: by second differences, which motion hardly
  /// has.
  double noise() const { return noise_; }
  /// Largest less smallest angle of each axis.
  Eigen::Vector2d range() const;

 private:
  size_t after(double time_s) const;  ///< first reading at or after it

  std::vector<double> times_, zoom_;
  std::vector<Eigen::Vector2d> angles_;
  double step_ = 0, noise_ = 0;
};

}  // namespace sightline::calibrate
