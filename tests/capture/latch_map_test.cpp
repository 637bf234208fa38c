// SPDX-License-Identifier: Apache-2.0
// The mapping by latches against a simulated device clock whose truth is known.
#include "capture/aravis/latch_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace sightline::capture {
namespace {

using namespace std::chrono_literals;

constexpr Time kStart = time_from_ns(5'000'000'000'000);

/// A device clock, and the way to it and back.
struct World {
  double drift = 0;
  double drift_change = 0;    // per second
  double way_us = 150;        // mean of each way's exponential part
  double read_jitter_us = 0;  // of every reading, frames' stamps as well
  double lost = 0;            // share of answers that come half a second later
  double held = 0;            // share of ways that take 4 ms, on a busy machine
  int64_t device_start = 77'000'000;
  std::mt19937_64 random{1};

  int64_t device_at(Time host) {
    const double seconds = to_seconds(host - kStart);
    double off = seconds * drift + seconds * seconds / 2 * drift_change;
    if (read_jitter_us > 0) off += std::normal_distribution(0.0, read_jitter_us * 1e-6)(random);
    return device_start + (host - kStart).count() + std::llround(off * 1e9);
  }
  Duration way() {
    const double mean_us = std::bernoulli_distribution(held)(random) ? 4000 : way_us;
    return 40us + from_seconds(std::exponential_distribution(1 / mean_us)(random) * 1e-6);
  }
  Latch latch(Time sent) {
    const Time at = sent + way();
    Time answered = at + way();
    if (std::bernoulli_distribution(lost)(random)) answered += 500ms;
    return {device_at(at), sent, answered};
  }
};

struct Outcome {
  int samples = 0, outside = 0;
  Duration largest_bound{0};  // after 10 s
};

// A latch each second, 25 stamps in between, as a source has them.
Outcome run(World& world, LatchMap& map, int seconds) {
  Outcome outcome;
  for (int i = 0; i < 5; ++i) map.add(world.latch(kStart + i * 2ms));
  for (int second = 0; second < seconds; ++second) {
    for (int i = 1; i <= 25; ++i) {
      const Time truth = kStart + 1s * second + 40ms * i;
      const auto mapped = map.map(world.device_at(truth));
      if (!mapped) {
        ADD_FAILURE() << "no mapping";
        return outcome;
      }
      ++outcome.samples;
      if (std::chrono::abs(mapped->time - truth) > mapped->bound) ++outcome.outside;
      if (second >= 10) outcome.largest_bound = std::max(outcome.largest_bound, mapped->bound);
    }
    map.add(world.latch(kStart + 1s * (second + 1)));
  }
  return outcome;
}

TEST(LatchMap, BoundHoldsUnderDriftAndJitter) {
  for (const double drift : {-80e-6, 0.0, 150e-6}) {
    for (const double way_us : {20.0, 150.0, 2000.0}) {
      for (const double read_jitter_us : {0.0, 30.0}) {
        World world;
        world.drift = drift;
        world.way_us = way_us;
        world.read_jitter_us = read_jitter_us;
        LatchMap map;
        const Outcome outcome = run(world, map, 240);
        SCOPED_TRACE(testing::Message() << "drift " << drift << ", way " << way_us << " us, read "
                                        << read_jitter_us << " us");
        EXPECT_LE(outcome.outside, outcome.samples / 1000);
        EXPECT_LT(to_seconds(outcome.largest_bound),
                  1e-6 * (300 + 4 * way_us + 15 * read_jitter_us));
        EXPECT_NEAR(map.drift(), drift, 5e-6 + 0.1e-6 * way_us);
      }
    }
  }
}

// A few latches are narrow and the others wide to one side, which turns the line of the first
// seconds: each start by itself has to keep its bound.
TEST(LatchMap, BoundHoldsFromTheStartOnABusyMachine) {
  Outcome all;
  int broken = 0;
  for (uint64_t seed = 1; seed <= 1000; ++seed) {
    World world;
    world.drift = 20e-6;
    world.way_us = 10;
    world.held = 0.3;
    world.random.seed(seed);
    LatchMap map;
    const Outcome outcome = run(world, map, 6);
    all.samples += outcome.samples;
    all.outside += outcome.outside;
    if (5 * outcome.outside > outcome.samples) ++broken;
  }
  EXPECT_EQ(broken, 0);
  EXPECT_LE(all.outside, all.samples / 1000);
}

TEST(LatchMap, BoundHoldsWhileTheCameraWarmsUpAndAnswersGetLost) {
  World world;
  world.drift = 40e-6;
  world.drift_change = 0.05e-6;  // 3 ppm a minute
  world.lost = 0.2;
  LatchMap map;
  const Outcome outcome = run(world, map, 400);
  EXPECT_LE(outcome.outside, outcome.samples / 1000);
  EXPECT_LT(outcome.largest_bound, 1500us);
}

TEST(LatchMap, AClockThatWasSetBeginsAnew) {
  World world;
  LatchMap map;
  (void)run(world, map, 20);
  for (const int64_t jump : {-10'000'000'000, 4'000'000'000}) {
    world.device_start += jump;
    const Time now = kStart + 21s;
    map.add(world.latch(now));
    const auto mapped = map.map(world.device_at(now + 20ms));
    ASSERT_TRUE(mapped.has_value());
    EXPECT_LE(std::chrono::abs(mapped->time - (now + 20ms)), mapped->bound);
    EXPECT_LT(mapped->bound, 2ms);
  }
}

TEST(LatchMap, WhatMakesNoSenseIsNotTaken) {
  LatchMap map;
  EXPECT_FALSE(map.map(1).has_value());
  map.add({0, kStart, kStart + 1ms});
  map.add({5, kStart + 1ms, kStart});
  EXPECT_TRUE(map.empty());
}

}  // namespace
}  // namespace sightline::capture
