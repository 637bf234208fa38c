// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <deque>

#include "sightline/geometry/head_drive.hpp"

namespace sightline::test {

/// A head with a mass: it hears orders late, gains and loses speed at its own acceleration, and
/// stops where it was sent. Time goes on in steps of kStep.
class SimulatedHead {
 public:
  static constexpr double kStep = 0.005;  // [s]

  SimulatedHead(double latency_s, double acceleration)
      : latency_(from_seconds(latency_s)), acceleration_(acceleration) {}

  void order(Time now, const HeadOrder& order) { orders_.push_back({now + latency_, order}); }
  /// Turns it by hand: orders are not heard meanwhile.
  void push(const HeadAngles& by) {
    angles_ += by;
    rates_.setZero();
    sent_.place = angles_;
    orders_.clear();
  }
  void run(Time now) {
    while (!orders_.empty() && orders_.front().at <= now) {
      sent_ = orders_.front().order;
      orders_.pop_front();
    }
    for (int axis = 0; axis < 2; ++axis) {
      const double way = sent_.place[axis] - angles_[axis];
      const double change = acceleration_ * kStep;
      const double stops = change * (std::sqrt(1 + 2 * std::abs(way) / (change * kStep)) - 1);
      const double wanted =
          std::copysign(std::min(std::max(std::abs(sent_.rate[axis]), kSlowest), stops), way);
      rates_[axis] = std::clamp(wanted, rates_[axis] - change, rates_[axis] + change);
      angles_[axis] += rates_[axis] * kStep;
    }
  }
  const HeadAngles& angles() const { return angles_; }
  const HeadAngles& rates() const { return rates_; }

 private:
  static constexpr double kSlowest = 0.02;  // [rad/s]
  struct Coming {
    Time at;
    HeadOrder order;
  };
  const Duration latency_;
  const double acceleration_;
  std::deque<Coming> orders_;
  HeadOrder sent_;
  HeadAngles angles_ = HeadAngles::Zero(), rates_ = HeadAngles::Zero();
};

}  // namespace sightline::test
