// SPDX-License-Identifier: Apache-2.0
// The mapping against a simulated device clock whose truth is known.
#include "sightline/capture/common/clock_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace sightline {
namespace {

using namespace std::chrono_literals;

constexpr int64_t kHostStart = 5'000'000'000'000;

/// A camera and the way to the host.
struct World {
  Duration period = 33'333'333ns;
  double drift = 0;         // of the device clock
  double drift_change = 0;  // per second
  Duration transit = 12ms;  // least
  double jitter_ms = 0.5;   // mean of the exponential part
  double loss = 0;          // share of frames that never come
  int64_t device_start = 77'000'000;
  std::mt19937_64 random{1};

  int64_t frame = 0;

  struct Frame {
    int64_t device_ns;
    Time truth;
    Time arrival;
    bool lost;
  };

  double device_at(double seconds) const {
    return seconds + drift * seconds + drift_change * seconds * seconds / 2;
  }

  Frame next() {
    const int64_t host = frame++ * period.count();
    const double seconds = static_cast<double>(host) * 1e-9;
    Frame made{};
    made.device_ns = device_start + std::llround(device_at(seconds) * 1e9);
    made.truth = time_from_ns(kHostStart + host);
    std::exponential_distribution<double> jitter(1 / jitter_ms);
    made.arrival = made.truth + transit + Duration(std::llround(jitter(random) * 1e6));
    made.lost = std::bernoulli_distribution(loss)(random);
    return made;
  }
};

ClockMapOptions options_for(const World& world) {
  ClockMapOptions options;
  options.period = world.period;
  options.transit = world.transit;
  return options;
}

struct Outcome {
  int samples = 0, outside = 0;
  double largest_error_ms = 0;  // after the first 35 s
  double largest_bound_ms = 0;  // after the first 35 s
};

Outcome run(World& world, ClockMap& map, int frames) {
  Outcome outcome;
  for (int i = 0; i < frames; ++i) {
    const World::Frame frame = world.next();
    if (frame.lost) continue;
    EXPECT_EQ(map.add(frame.device_ns, frame.arrival), ClockMap::Event::kTaken) << "frame " << i;
    const auto mapped = map.map(frame.device_ns);
    if (!mapped) {
      ADD_FAILURE() << "no mapping";
      return outcome;
    }
    const Duration error = std::chrono::abs(mapped->time - frame.truth);
    ++outcome.samples;
    if (error > mapped->bound) ++outcome.outside;
    if (static_cast<double>(i) * to_seconds(world.period) < 35) continue;
    outcome.largest_error_ms = std::max(outcome.largest_error_ms, to_seconds(error) * 1e3);
    outcome.largest_bound_ms = std::max(outcome.largest_bound_ms, to_seconds(mapped->bound) * 1e3);
  }
  return outcome;
}

void expect_bound_holds(const Outcome& outcome) {
  EXPECT_LE(outcome.outside, outcome.samples / 1000) << "of " << outcome.samples;
}

TEST(ClockMap, BoundHoldsUnderDriftAndJitter) {
  for (const double drift : {-80e-6, 0.0, 150e-6}) {
    for (const double jitter_ms : {0.05, 0.5, 3.0}) {
      World world;
      world.drift = drift;
      world.jitter_ms = jitter_ms;
      ClockMap map(options_for(world));
      const Outcome outcome = run(world, map, 6000);
      SCOPED_TRACE(testing::Message() << "drift " << drift << " jitter " << jitter_ms);
      expect_bound_holds(outcome);
      EXPECT_LT(outcome.largest_error_ms, 0.1 + 0.25 * jitter_ms);
      EXPECT_LT(outcome.largest_bound_ms, 0.2 + 1.5 * jitter_ms);
      EXPECT_NEAR(map.drift(), drift, 2e-6 + 8e-6 * jitter_ms);
      EXPECT_EQ(map.resets(), 0u);
    }
  }
}

TEST(ClockMap, BoundHoldsWithLossAndChangingDrift) {
  World world;
  world.drift = 40e-6;
  world.drift_change = 0.05e-6;  // 3 ppm a minute: a camera that warms up
  world.loss = 0.2;
  world.jitter_ms = 1;
  ClockMap map(options_for(world));
  const Outcome outcome = run(world, map, 9000);
  expect_bound_holds(outcome);
  EXPECT_LT(outcome.largest_bound_ms, 2.5);
}

TEST(ClockMap, BoundHoldsFromTheFirstFrameOn) {
  Outcome all;
  for (unsigned seed = 0; seed < 300; ++seed) {
    World world;
    world.random.seed(seed);
    world.drift = 100e-6;
    world.jitter_ms = 2;
    ClockMap map(options_for(world));
    const Outcome outcome = run(world, map, 60);
    all.samples += outcome.samples;
    all.outside += outcome.outside;
  }
  expect_bound_holds(all);
}

TEST(ClockMap, SlowCamerasToo) {
  World world;
  world.period = 2s;
  world.drift = 30e-6;
  ClockMap map(options_for(world));
  expect_bound_holds(run(world, map, 1000));
}

TEST(ClockMap, UnknownTransitIsInTheBound) {
  World world;
  ClockMapOptions options = options_for(world);
  options.transit = 10ms;  // truth: 12 ms
  options.transit_error = 3ms;
  ClockMap map(options);
  const Outcome outcome = run(world, map, 2000);
  EXPECT_EQ(outcome.outside, 0);
  EXPECT_NEAR(outcome.largest_error_ms, 2, 0.3);
}

TEST(ClockMap, NoMappingBeforeTheFirstPair) {
  const ClockMap map({});
  EXPECT_FALSE(map.map(1).has_value());
  EXPECT_EQ(map.bound(), Duration{0});
}

TEST(ClockMap, RejectsStampsThatMakeNoSense) {
  World world;
  ClockMap map(options_for(world));
  run(world, map, 300);
  const World::Frame frame = world.next();
  EXPECT_EQ(map.add(0, frame.arrival), ClockMap::Event::kRejected);
  EXPECT_EQ(map.add(-5, frame.arrival), ClockMap::Event::kRejected);
  EXPECT_EQ(map.add(frame.device_ns - 1'000'000'000, frame.arrival), ClockMap::Event::kRejected);
  EXPECT_EQ(map.add(frame.device_ns + 50'000'000, frame.arrival), ClockMap::Event::kRejected);
  EXPECT_EQ(map.rejected(), 4u);
  // The next good one is taken, and the mapping has not moved.
  EXPECT_EQ(map.add(frame.device_ns, frame.arrival), ClockMap::Event::kTaken);
  EXPECT_LT(std::chrono::abs(map.map(frame.device_ns)->time - frame.truth), 1ms);
  expect_bound_holds(run(world, map, 300));
}

// A counter that wraps, is set to 0, or is stepped: after a few frames that agree, a new mapping.
TEST(ClockMap, BeginsAnewWhenTheDeviceClockJumps) {
  for (const int64_t jump : {int64_t{-70'000'000}, int64_t{500'000'000}, int64_t{-4'000'000'000},
                             int64_t{3'600'000'000'000}}) {
    World world;
    world.device_start = 1'000'000'000'000;
    ClockMap map(options_for(world));
    run(world, map, 600);
    world.device_start += jump;
    int frames = 0;
    ClockMap::Event event{};
    do {
      const World::Frame frame = world.next();
      event = map.add(frame.device_ns, frame.arrival);
    } while (event != ClockMap::Event::kReset && ++frames < 200);
    SCOPED_TRACE(testing::Message() << "jump " << jump);
    EXPECT_LT(frames, 120);  // at worst by the slow way: late for three seconds
    EXPECT_EQ(map.resets(), 1u);
    expect_bound_holds(run(world, map, 600));
  }
}

TEST(ClockMap, AStandingClockNeverBecomesAnEpoch) {
  World world;
  ClockMap map(options_for(world));
  run(world, map, 100);
  const int64_t standing = world.next().device_ns;
  ClockMap::Event event = map.add(standing, world.next().arrival);
  for (int i = 0; i < 100; ++i) event = map.add(standing, world.next().arrival);
  EXPECT_EQ(event, ClockMap::Event::kRejected);
  EXPECT_EQ(map.resets(), 0u);
}

TEST(ClockMap, BeginsAnewAfterALongSilence) {
  World world;
  world.drift = 100e-6;
  ClockMap map(options_for(world));
  run(world, map, 300);
  world.frame += 3600 * 30;
  expect_bound_holds(run(world, map, 300));
  EXPECT_EQ(map.resets(), 0u);
}

TEST(ClockMap, ResetForgets) {
  World world;
  ClockMap map(options_for(world));
  run(world, map, 10);
  map.reset();
  EXPECT_FALSE(map.map(1).has_value());
  expect_bound_holds(run(world, map, 10));
}

TEST(ClockMap, LongRunsKeepTheirPrecision) {
  World world;
  world.drift = 20e-6;
  world.jitter_ms = 0.05;
  world.frame = 400LL * 86400 * 30;  // 400 days
  ClockMap map(options_for(world));
  const Outcome outcome = run(world, map, 3000);
  expect_bound_holds(outcome);
  EXPECT_LT(outcome.largest_error_ms, 0.1);
}

}  // namespace
}  // namespace sightline
