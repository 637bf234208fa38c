// SPDX-License-Identifier: Apache-2.0
// Phase and drift of two cameras whose truth is known.
#include "sightline/capture/common/camera_sync.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace sightline {
namespace {

using namespace std::chrono_literals;

struct Camera {
  double period = 0.04;
  double first = 0;  // seconds
  double drift = 0;  // of its period
  double noise = 0;  // of its stamps
  double loss = 0;
  Duration error = 200us;
  uint32_t seed = 1;

  std::vector<SyncStamp> frames(double seconds) const {
    std::mt19937 random(seed);
    std::vector<SyncStamp> stamps;
    for (double t = first; t < first + seconds; t += period * (1 + drift)) {
      if (std::bernoulli_distribution(loss)(random)) continue;
      const double off = noise > 0 ? std::normal_distribution(0.0, noise)(random) : 0;
      stamps.push_back({time_from_ns(9'000'000'000) + from_seconds(t + off), error});
    }
    return stamps;
  }
};

TEST(CameraSync, PhaseAndDriftWithLossAndNoise) {
  for (const double phase : {-0.015, 0.0, 0.003, 0.0199}) {
    for (const double drift : {-60e-6, 0.0, 100e-6}) {
      const Camera a{.noise = 50e-6, .loss = 0.1};
      const Camera b{.first = phase, .drift = drift, .noise = 50e-6, .loss = 0.1, .seed = 2};
      const SyncReport report = measure_sync(a.frames(20), b.frames(20));
      SCOPED_TRACE(testing::Message() << "phase " << phase << ", drift " << drift);
      EXPECT_NEAR(report.drift, drift, report.drift_error);
      const double off = std::remainder(to_seconds(report.phase) - (phase + drift * 20), 0.04);
      EXPECT_LE(std::abs(off), to_seconds(report.phase_error));
      EXPECT_NEAR(report.rate_a_hz, 25, 0.1);
      EXPECT_NEAR(to_seconds(report.jitter), 70e-6, 30e-6);
      EXPECT_LT(report.phase_error, 600us);
    }
  }
}

TEST(CameraSync, ThePhaseRunsThroughSeveralPeriods) {
  const Camera a, b{.first = 0.01, .drift = 5e-3};
  const SyncReport report = measure_sync(a.frames(30), b.frames(30));
  EXPECT_NEAR(report.drift, 5e-3, 1e-4);
}

TEST(CameraSync, HalfTheRateAndNothingAtAll) {
  const Camera a, b{.period = 0.08, .first = 0.001};
  const SyncReport half = measure_sync(a.frames(10), b.frames(10));
  EXPECT_NEAR(half.rate_b_hz, 12.5, 0.1);
  EXPECT_EQ(half.frames_b, 125u);
  const SyncReport none = measure_sync(a.frames(10), {});
  EXPECT_EQ(none.pairs, 0u);
  EXPECT_EQ(none.rate_b_hz, 0);
}

}  // namespace
}  // namespace sightline
