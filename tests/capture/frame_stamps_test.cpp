// SPDX-License-Identifier: Apache-2.0
#include "capture/common/frame_stamps.hpp"

#include <gtest/gtest.h>

#include <chrono>

namespace sightline::capture {
namespace {

using namespace std::chrono_literals;

constexpr Time at(Duration since) { return time_from_ns(0) + 100s + since; }

// The middle of the true exposure lies within the bound, whatever exposure and readout are.
TEST(StampMapper, BoundHoldsForEveryExposureAndReadout) {
  const Duration period = 40ms;
  for (Duration exposure = 0ms; exposure <= period; exposure += 5ms) {
    for (Duration readout = 0ms; readout <= period; readout += 5ms) {
      const Time start = at(0ms), middle = start + exposure / 2;
      const Time end = start + exposure + readout, arrival = end + 2ms;
      for (const bool known : {false, true}) {
        const auto given = known ? std::optional(exposure) : std::nullopt;
        StampMapper by_start(StampPoint::kStartOfExposure, period, given);
        const auto a = by_start.map(start, arrival);
        EXPECT_LE(std::chrono::abs(a.capture - middle), a.error);
        StampMapper by_end(StampPoint::kEndOfFrame, period, given);
        const auto b = by_end.map(end, arrival);
        EXPECT_LE(std::chrono::abs(b.capture - middle), b.error);
        EXPECT_FALSE(a.stamp_rejected || b.stamp_rejected);
      }
    }
  }
}

TEST(StampMapper, KnownExposureGivesANarrowBound) {
  StampMapper mapper(StampPoint::kStartOfExposure, 33ms, 10ms);
  const auto time = mapper.map(at(0ms), at(30ms));
  EXPECT_EQ(time.capture, at(5ms));
  EXPECT_EQ(time.error, 500us);
}

TEST(StampMapper, ImpossibleStampsAreReplacedByTheArrival) {
  const Duration period = 40ms;
  const auto rejects = [&](std::optional<Time> stamp) {
    StampMapper mapper(StampPoint::kStartOfExposure, period, std::nullopt);
    EXPECT_FALSE(mapper.map(at(0ms), at(30ms)).stamp_rejected);
    const auto time = mapper.map(stamp, at(70ms));
    EXPECT_TRUE(!time.stamp_rejected || (time.capture == at(70ms) && time.error == 2 * period));
    return time.stamp_rejected;
  };
  EXPECT_TRUE(rejects(std::nullopt));
  EXPECT_TRUE(rejects(time_from_ns(0)));
  EXPECT_TRUE(rejects(at(-1ms)));   // goes back
  EXPECT_TRUE(rejects(at(0ms)));    // stands still
  EXPECT_TRUE(rejects(at(120ms)));  // more than a period ahead
  EXPECT_TRUE(rejects(at(-11s)));
  EXPECT_FALSE(rejects(at(40ms)));
}

TEST(StampMapper, NeverSaysThatAFrameWasExposedAfterItArrived) {
  StampMapper mapper(StampPoint::kStartOfExposure, 40ms, 20ms);
  const auto time = mapper.map(at(30ms), at(5ms));
  EXPECT_FALSE(time.stamp_rejected);
  EXPECT_EQ(time.capture, at(5ms));
  EXPECT_GE(time.error, 35ms);
}

TEST(StampMapper, OneWrongStampDoesNotCondemnTheNext) {
  StampMapper mapper(StampPoint::kStartOfExposure, 40ms, std::nullopt);
  EXPECT_FALSE(mapper.map(at(35ms), at(0ms)).stamp_rejected);
  EXPECT_TRUE(mapper.map(at(30ms), at(40ms)).stamp_rejected);
  EXPECT_FALSE(mapper.map(at(31ms), at(80ms)).stamp_rejected);
}

}  // namespace
}  // namespace sightline::capture
