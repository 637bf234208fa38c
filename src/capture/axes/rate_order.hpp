// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "sightline/base/time.hpp"
#include "sightline/geometry/head_drive.hpp"

namespace sightline::capture {

/// An order as a head hears it that turns at rates only. A place stops such a head as the end of
/// its way does another: it turns for as long as an order is in force without a next one, and not
/// through the place. Angles and rates as the device counts them.
class RateOrder {
 public:
  void take(const HeadOrder& order, Time now) {
    order_ = order;
    taken_ = now;
  }
  /// What is to be turned at now, by the newest angles [rad/s]; zero: stand.
  HeadAngles rates(Time now, const HeadAngles& angles) const {
    if (now - taken_ > from_seconds(AxisDrive::kAhead)) return HeadAngles::Zero();
    HeadAngles out = order_.rate;
    for (int axis = 0; axis < 2; ++axis) {
      const double way = order_.place[axis] - angles[axis];
      if (out[axis] * way <= 0 || std::abs(way) < kClose) out[axis] = 0;
    }
    return out;
  }
  const HeadAngles& place() const { return order_.place; }

 private:
  /// [rad]: nearer than this the slowest rate of most heads would go past it, to and fro.
  static constexpr double kClose = 0.0087;
  HeadOrder order_;
  Time taken_{};
};

}  // namespace sightline::capture
