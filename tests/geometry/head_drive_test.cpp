// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/head_drive.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "head_axes.hpp"
#include "support/random.hpp"
#include "support/simulated_head.hpp"

namespace sightline {
namespace {

using test::SimulatedHead;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kOrderEvery = 0.05;  // [s]

Time at_s(double seconds) { return Time{} + from_seconds(100 + seconds); }

TEST(AimHead, ARayMeetsThePoint) {
  const CameraAxes axes = test::head_axes();
  test::Random random(5);
  int found = 0;
  for (int i = 0; i < 300; ++i) {
    const HeadAngles truth(2.5 * random.uniform(-1, 1), 0.9 * random.uniform(-1, 1));
    const Eigen::Vector3d ray =
        Eigen::Vector3d(0.2 * random.uniform(-1, 1), 0.2 * random.uniform(-1, 1), 1).normalized();
    const Rigid3 pose = axes.world_from_camera(truth.x(), truth.y());
    const Eigen::Vector3d point = pose * ((1.5 + random.uniform(-1, 1)) * ray);
    const HeadAngles near =
        truth + HeadAngles(0.8 * random.uniform(-1, 1), 0.4 * random.uniform(-1, 1));
    const auto angles = aim_head(axes, point, ray, near);
    if (!angles) continue;
    ++found;
    const Eigen::Vector3d seen = axes.world_from_camera(angles->x(), angles->y()).inverse() * point;
    EXPECT_GT(seen.normalized().dot(ray), 1 - 1e-10);
    EXPECT_LT((*angles - truth).norm(), 1e-6);
  }
  EXPECT_GE(found, 298);
}

TEST(AimHead, APointInTheMiddleOfTheHeadHasNoDirection) {
  const CameraAxes axes;
  EXPECT_FALSE(aim_head(axes, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ(), {0, 0}));
}

struct Course {
  HeadLimits limits;
  double latency_s = 0.2;  ///< of the head itself
  double reading_late_s = 0.03;
  std::function<double(double)> target, rate;
  double seconds = 10;
  /// After each step: time, target, the head's angle and rate.
  std::function<void(double, double, double, double)> look;
};

// One axis of a head that is driven, with readings every 25 ms in steps of 0.05 degrees.
void drive(const Course& run) {
  AxisDrive drive(run.limits, 0);
  SimulatedHead head(run.latency_s, 1.5 * run.limits.acceleration);
  std::deque<std::pair<Time, double>> readings;
  double next_order = 0, next_reading = 0, last_rate = 0;
  for (double t = 0; t < run.seconds; t += SimulatedHead::kStep) {
    const Time now = at_s(t);
    head.run(now);
    if (t >= next_reading) {
      const double rounded = std::round(head.angles().x() / (0.05 * kDegree)) * 0.05 * kDegree;
      readings.emplace_back(now, rounded);
      next_reading += 0.025;
    }
    const Time heard = now - from_seconds(run.reading_late_s);
    while (readings.size() > 1 && readings[1].first <= heard) readings.pop_front();
    if (t >= next_order && readings.front().first <= heard) {
      const double when = t + run.limits.latency_s;
      const auto order = drive.step(now, readings.front().first, readings.front().second,
                                    run.target(when), run.rate(when));
      EXPECT_LE(std::abs(order.rate), run.limits.max_rate + 1e-12);
      EXPECT_LE(std::abs(order.rate - last_rate), run.limits.acceleration * 0.1 + 1e-12);
      EXPECT_GE(order.place, run.limits.low.x());
      EXPECT_LE(order.place, run.limits.high.x());
      last_rate = order.rate;
      head.order(now, {{order.place, 0}, {order.rate, 0}});
      next_order += kOrderEvery;
    }
    if (run.look) run.look(t, run.target(t), head.angles().x(), head.rates().x());
  }
}

Course to_rest(double place) {
  Course run;
  run.target = [place](double) { return place; };
  run.rate = [](double) { return 0.0; };
  return run;
}

// A loop that did not foresee would swing for ever from a gain of pi/2 / (0.2 s + 0.06 s) = 6 on.
TEST(AxisDrive, ALoopWith200MsOfLatencyIsStable) {
  for (const double gain : {1.0, 3.0, 8.0}) {
    for (const double believed : {0.1, 0.2, 0.3}) {
      if (gain > 3 && believed != 0.2) continue;  // a latency that is off limits the gain
      Course run = to_rest(30 * kDegree);
      run.limits.gain = gain;
      run.limits.latency_s = believed;
      double highest = 0, late = 0;
      run.look = [&](double t, double, double angle, double) {
        highest = std::max(highest, angle);
        if (t > 6) late = std::max(late, std::abs(angle - 30 * kDegree));
      };
      drive(run);
      EXPECT_LT(highest, 32 * kDegree) << gain << " " << believed;
      EXPECT_LT(late, 0.2 * kDegree) << gain << " " << believed;
    }
  }
}

TEST(AxisDrive, AMovingTargetIsFollowedWithoutLag) {
  Course run;
  run.limits.latency_s = 0.2;
  const double swing = 25 * kDegree, turn = 1.4;
  run.target = [=](double t) { return swing * std::sin(turn * t); };
  run.rate = [=](double t) { return swing * turn * std::cos(turn * t); };
  double worst = 0;
  run.look = [&](double t, double target, double angle, double) {
    if (t > 3) worst = std::max(worst, std::abs(target - angle));
  };
  drive(run);
  EXPECT_LT(worst, 2.5 * kDegree);  // of a swing of 25; 35 degrees a second, 7 in a latency
}

TEST(AxisDrive, LimitsHoldOnAnyWay) {
  test::Random random(11);
  for (int trial = 0; trial < 40; ++trial) {
    Course run;
    run.limits.low.x() = -40 * kDegree;
    run.limits.high.x() = 25 * kDegree;
    run.limits.max_rate = (30 + 25 * random.uniform(-1, 1)) * kDegree;
    run.limits.acceleration = (80 + 60 * random.uniform(-1, 1)) * kDegree;
    run.limits.gain = 3 + 2 * random.uniform(-1, 1);
    run.limits.latency_s = 0.15 + 0.1 * random.uniform(-1, 1);
    run.latency_s = 0.15 + 0.1 * random.uniform(-1, 1);
    std::vector<double> places, rates;
    for (int i = 0; i < 40; ++i) {
      places.push_back(90 * kDegree * random.uniform(-1, 1));
      rates.push_back(200 * kDegree * random.uniform(-1, 1));
    }
    const auto pick = [](const std::vector<double>& list, double t) {
      return list[static_cast<size_t>(t * 2.5) % list.size()];
    };
    run.target = [&](double t) { return pick(places, t); };
    run.rate = [&](double t) { return pick(rates, t); };
    run.look = [&](double, double, double angle, double rate) {
      // The head itself stops to a hundredth of a degree.
      EXPECT_GE(angle, run.limits.low.x() - 0.01 * kDegree);
      EXPECT_LE(angle, run.limits.high.x() + 0.01 * kDegree);
      EXPECT_LE(std::abs(rate), run.limits.max_rate + 1e-9);
    };
    drive(run);
    if (testing::Test::HasFailure()) return;
  }
}

TEST(AxisDrive, AHeadThatHearsNoMoreStopsByItself) {
  HeadLimits limits;
  AxisDrive drive(limits, 0);
  SimulatedHead head(0.1, 1.5 * limits.acceleration);
  double t = 0;
  for (int i = 0; t < 4; ++i, t += SimulatedHead::kStep) {
    head.run(at_s(t));
    if (t < 1 && i % 10 == 0) {
      const auto order = drive.step(at_s(t), at_s(t), head.angles().x(), 2.5, 0);
      head.order(at_s(t), {{order.place, 0}, {order.rate, 0}});
    }
  }
  EXPECT_LT(head.angles().x(), 1.7);  // of 2.5: it was on the way
  EXPECT_LT(std::abs(head.rates().x()), 0.01);
}

}  // namespace
}  // namespace sightline
