// SPDX-License-Identifier: Apache-2.0
#include "stream/rtp_clock.hpp"

#include <gtest/gtest.h>

namespace sightline::stream {
namespace {

constexpr int64_t kMs = 1'000'000;
constexpr int64_t kSecond = 1'000 * kMs;

TEST(RtpClock, LiveCaptureTimesAreKeptExactly) {
  RtpClock clock;
  const int64_t base = 100 * kSecond;
  for (const int64_t at : {5 * kMs, 38 * kMs, 200 * kMs, 201 * kMs}) {
    const int64_t capture = base + at;
    EXPECT_EQ(clock.running_time(capture, capture + 12 * kMs, base), static_cast<uint64_t>(at));
  }
}

TEST(RtpClock, TwoStreamsOfLiveCamerasShareOneClock) {
  RtpClock left, right;
  left.running_time(10 * kSecond, 10 * kSecond + 5 * kMs, 9 * kSecond);
  const uint64_t l = left.running_time(11 * kSecond, 11 * kSecond + 5 * kMs, 9 * kSecond);
  const uint64_t r = right.running_time(11 * kSecond, 11 * kSecond + 60 * kMs, 9 * kSecond);
  EXPECT_EQ(l, r);
}

TEST(RtpClock, RecordedTimesAreMovedToNowAndKeepTheirDistances) {
  RtpClock clock;
  const int64_t base = 1'000 * kSecond;
  const int64_t now = base + 50 * kMs;
  const uint64_t first = clock.running_time(3 * kSecond, now, base);
  EXPECT_EQ(first, static_cast<uint64_t>(50 * kMs));
  const uint64_t second = clock.running_time(3 * kSecond + 33 * kMs, now + 40 * kMs, base);
  EXPECT_EQ(second - first, static_cast<uint64_t>(33 * kMs));
}

TEST(RtpClock, GrowsStrictlyWhenCaptureTimesRepeatOrJumpBack) {
  RtpClock clock;
  const int64_t base = 1'000 * kSecond;
  uint64_t last = clock.running_time(30 * kSecond, base + kSecond, base);
  int64_t now = base + kSecond;
  for (const int64_t capture : {30 * kSecond, 29 * kSecond, 0 * kSecond, 1 * kSecond, 900 * kSecond,
                                901 * kSecond, 5 * kSecond}) {
    now += kSecond;
    const uint64_t time = clock.running_time(capture, now, base);
    EXPECT_GT(time, last);
    // Never far from now, whatever the source says.
    EXPECT_LE(static_cast<int64_t>(time), now - base + kSecond);
    EXPECT_GE(static_cast<int64_t>(time), now - base - 5 * kSecond);
    last = time;
  }
}

TEST(RtpClock, AnImageFromBeforeTheStartBeginsAtZero) {
  RtpClock clock;
  EXPECT_EQ(clock.running_time(kSecond - 8 * kMs, kSecond + kMs, kSecond), 0u);
}

}  // namespace
}  // namespace sightline::stream
