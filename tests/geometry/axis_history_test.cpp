// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/axis_history.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "head_axes.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

constexpr double kDegree = std::numbers::pi / 180;

Time at_ms(double ms) { return time_from_ns(5'000'000'000 + std::llround(1e6 * ms)); }

double swing(double ms) { return 20 * kDegree * std::sin(3 * 1e-3 * ms); }  // 60 deg/s at most
double nod(double ms) { return 4 * kDegree * std::sin(2e-3 * ms + 0.3); }

/// As an encoder of 0.05 deg says it, `latency` late.
AxisReading reading(double ms, double latency_ms = 0, double step = 0.05 * kDegree) {
  const auto coarse = [step](double angle) { return std::round(angle / step) * step; };
  return {at_ms(ms), coarse(swing(ms - latency_ms)), coarse(nod(ms - latency_ms)), 0, true};
}

CameraAxes axes_with(double latency_s) {
  CameraAxes axes = test::head_axes();
  axes.latency_s = latency_s;
  axes.sigma = 0.05 * kDegree / std::sqrt(12.0);
  return axes;
}

TEST(AxisHistory, NothingReadIsNotBelieved) {
  AxisHistory history(axes_with(0), 500);
  EXPECT_EQ(history.at(at_ms(0)).state, AxesState::kSilent);
  EXPECT_FALSE(history.place_at(at_ms(0))->trusted());
  EXPECT_GT(history.at(at_ms(0)).pan_sigma, 3);
}

TEST(AxisHistory, BetweenReadingsAndBehindTheirLatencyAnglesAreExact) {
  AxisHistory history(axes_with(0.040), 500);
  for (double ms = 0; ms <= 1000; ms += 10) history.add(reading(ms, 40));
  double worst = 0;
  for (double ms = 100; ms <= 950; ms += 3.3) {
    const AxesAt at = history.at(at_ms(ms));
    ASSERT_EQ(at.state, AxesState::kKnown);
    worst = std::max({worst, std::abs(at.pan - swing(ms)), std::abs(at.tilt - nod(ms))});
  }
  EXPECT_LT(worst, 0.03 * kDegree);
  EXPECT_GT(worst, 0.0005 * kDegree);  // it was rounded
}

TEST(AxisHistory, WithoutItsLatencyAnglesAreLate) {
  AxisHistory history(axes_with(0), 500);
  for (double ms = 0; ms <= 1000; ms += 10) history.add(reading(ms, 40));
  double worst = 0;
  for (double ms = 100; ms <= 950; ms += 3.3) {
    worst = std::max(worst, std::abs(history.at(at_ms(ms)).pan - swing(ms)));
  }
  EXPECT_NEAR(worst, 2.4 * kDegree, 0.1 * kDegree);  // 60 deg/s x 40 ms
}

// Normalized errors of angles that are up to 60 ms ahead of the newest reading: sigma must be
// honest, neither too small nor useless.
TEST(AxisHistory, ExtrapolatedAnglesKeepWithinTheirSigma) {
  CameraAxes axes = axes_with(0.040);
  axes.acceleration = 3;
  AxisHistory history(axes, 500);
  int within = 0, all = 0;
  double largest = 0, sum = 0;
  for (double ms = 0; ms <= 4000; ms += 10) {
    history.add(reading(ms, 40));
    if (ms < 200) continue;
    for (const double ahead : {2.0, 10.0, 20.0}) {
      const AxesAt at = history.at(at_ms(ms + ahead));
      ASSERT_EQ(at.state, AxesState::kKnown);
      const double error = std::abs(at.pan - swing(ms + ahead));
      within += error < 2 * at.pan_sigma ? 1 : 0;
      largest = std::max(largest, error);
      sum += at.pan_sigma;
      ++all;
    }
  }
  EXPECT_GT(within, 0.95 * all);
  EXPECT_LT(largest, 0.3 * kDegree);
  EXPECT_LT(sum / all, 0.35 * kDegree);
}

TEST(AxisHistory, SigmaHoldsLatencyAndPlay) {
  CameraAxes axes = axes_with(0.040);
  axes.latency_sigma_s = 0.005;
  AxisHistory history(axes, 500);
  for (double ms = 0; ms <= 1000; ms += 10) history.add({at_ms(ms), 1e-3 * ms, 0, 0, true});
  AxesAt at = history.at(at_ms(500));
  EXPECT_NEAR(at.pan_rate, 1.0, 1e-6);
  EXPECT_NEAR(at.pan_sigma, std::hypot(0.005, axes.sigma), 1e-4);
  EXPECT_LT(at.tilt_sigma, 2 * axes.sigma);
  axes.latency_sigma_s = 0;
  axes.backlash = 0.01;
  AxisHistory loose(axes, 500);
  for (double ms = 0; ms <= 1000; ms += 10) loose.add({at_ms(ms), 1e-3 * ms, 0, 0, true});
  at = loose.at(at_ms(500));
  EXPECT_NEAR(at.pan_sigma, 0.01 / std::sqrt(12.0), 2e-4);
}

TEST(AxisHistory, CovarianceIsThatOfTheScatterOfPoses) {
  CameraAxes axes = axes_with(0);
  axes.sigma = 0.004;
  AxisHistory history(axes, 500);
  for (double ms = 0; ms <= 100; ms += 10) history.add({at_ms(ms), 0.4, -0.2, 0, false});
  const CameraPlacePtr place = history.place_at(at_ms(55));
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, 0.004);
  Matrix6 scatter = Matrix6::Zero();
  constexpr int kDraws = 20'000;
  for (int i = 0; i < kDraws; ++i) {
    const Rigid3 drawn = axes.world_from_camera(0.4 + noise(random), -0.2 + noise(random));
    const Vector6 d = (drawn * place->world_from_camera.inverse()).log();
    scatter += d * d.transpose() / kDraws;
  }
  EXPECT_LT((scatter - *place->covariance).norm(), 0.05 * scatter.norm());
}

TEST(AxisHistory, DeviceThatFallsSilentLosesItsVote) {
  CameraAxes axes = axes_with(0.040);
  AxisHistory history(axes, 500);
  for (double ms = 0; ms <= 1000; ms += 10) history.add(reading(ms, 40));
  double before = 0;
  for (double ms = 960; ms < 1000 + 1e3 * axes.stale_s - 40; ms += 10) {
    const AxesAt at = history.at(at_ms(ms));
    EXPECT_EQ(at.state, AxesState::kKnown) << ms;
    EXPECT_GT(at.pan_sigma, before);
    before = at.pan_sigma;
  }
  EXPECT_GT(before, 1 * kDegree);
  EXPECT_EQ(history.at(at_ms(1120)).state, AxesState::kSilent);
  EXPECT_EQ(history.at(at_ms(60'000)).state, AxesState::kSilent);
  EXPECT_GT(history.at(at_ms(60'000)).pan_sigma, 1);
}

TEST(AxisHistory, AnglesThatStandStillThoughItTurnsAreFrozen) {
  AxisHistory history(axes_with(0), 500);
  for (double ms = 0; ms <= 500; ms += 10) history.add(reading(ms));
  AxisReading stuck = reading(500);
  AxesState state{};
  double frozen_at = 0;
  for (double ms = 510; ms <= 1000 && state != AxesState::kFrozen; ms += 10) {
    stuck.stamp = at_ms(ms);
    history.add(stuck);
    state = history.at(at_ms(ms)).state;
    frozen_at = ms;
  }
  EXPECT_EQ(state, AxesState::kFrozen);
  EXPECT_NEAR(frozen_at, 760, 15);
  // Standing still without an order to turn is no fault.
  AxisHistory standing(axes_with(0), 500);
  for (double ms = 0; ms <= 2000; ms += 10) standing.add({at_ms(ms), 0.1, 0.1, 0, false});
  EXPECT_EQ(standing.at(at_ms(2000)).state, AxesState::kKnown);
  standing.add({at_ms(2010), 0.1, 0.1, 0, true});  // begins to turn
  EXPECT_EQ(standing.at(at_ms(2010)).state, AxesState::kKnown);
}

TEST(AxisHistory, JumpsOfTheClockStartAnew) {
  for (const double jump_ms : {-700.0, +60'000.0}) {
    AxisHistory history(axes_with(0), 500);
    for (double ms = 0; ms <= 500; ms += 10) history.add(reading(ms));
    ASSERT_EQ(history.at(at_ms(500)).state, AxesState::kKnown);
    for (int i = 0; i < AxisHistory::kSettled - 1; ++i) {
      history.add(reading(510 + jump_ms + 10 * i));
      EXPECT_EQ(history.at(at_ms(510 + jump_ms + 10 * i)).state, AxesState::kUnsettled);
    }
    for (int i = 4; i < 9; ++i) history.add(reading(510 + jump_ms + 10 * i));
    EXPECT_EQ(history.at(at_ms(590 + jump_ms)).state, AxesState::kKnown);
  }
}

TEST(AxisHistory, AnglesThatNoHeadCanReachStartAnew) {
  AxisHistory history(axes_with(0), 500);
  for (double ms = 0; ms <= 500; ms += 10) history.add({at_ms(ms), 0, 0, 0, false});
  history.add({at_ms(510), 1.5, 0, 0, false});
  EXPECT_EQ(history.at(at_ms(510)).state, AxesState::kUnsettled);
  history.add({at_ms(520), std::nan(""), 0, 0, false});
  history.add({at_ms(530), 1e30, 0, 0, false});
  EXPECT_DOUBLE_EQ(history.at(at_ms(515)).pan, 1.5);
}

TEST(AxisHistory, ZoomAwayFromTheLensInUseIsNotBelieved) {
  CameraAxes axes = axes_with(0);
  axes.zoom = {{0, 500, 500, 320, 240, {}, 0.001}, {100, 1000, 1000, 320, 240, {}, 0.001}};
  AxisHistory history(axes, 500);
  for (double ms = 0; ms <= 100; ms += 10) history.add({at_ms(ms), 0, 0, 0, false});
  EXPECT_EQ(history.at(at_ms(100)).state, AxesState::kKnown);
  history.add({at_ms(110), 0, 0, 10, false});
  EXPECT_EQ(history.at(at_ms(110)).state, AxesState::kZoomed);
}

TEST(AxisHistory, KeepsBoundedMemory) {
  AxisHistory history(axes_with(0), 500);
  for (int i = 0; i < 100'000; ++i) {
    history.add({at_ms(0.01 * i), 1e-6 * i, 0, 0, true});
  }
  EXPECT_LT(history.place_at(at_ms(1000))->readings.size(), 5000u);
  EXPECT_EQ(history.at(at_ms(1000)).state, AxesState::kKnown);
}

}  // namespace
}  // namespace sightline
