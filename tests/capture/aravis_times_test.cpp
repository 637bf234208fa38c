// SPDX-License-Identifier: Apache-2.0
// From an Aravis camera's stamps to the middle of exposure, and what the bound admits.
#include "capture/aravis/aravis_times.hpp"

#include <gtest/gtest.h>

namespace sightline::capture {
namespace {

using namespace std::chrono_literals;

constexpr Duration kPeriod = 40ms;
constexpr Duration kExposure = 8ms;
constexpr Duration kReadout = 3ms;  // from the end of exposure to the first packet
constexpr int64_t kDeviceStart = 1'000'000'000;

AravisSettings settings() {
  AravisSettings settings;
  settings.rate_hz = 25;
  settings.exposure_us = 8000;
  settings.payload = 500'000;  // 4 ms at a gigabit
  return settings;
}

struct Result {
  FrameInfo info;
  Duration error{0};  // of capture against the true middle of exposure
};

// The last of `frames` frames of a camera that stamps at `stamp_after` its exposure's start.
Result run(const AravisOptions& options, const AravisSettings& set, Duration stamp_after,
           int frames = 200) {
  AravisTimes times(options, set);
  Result result;
  for (int i = 0; i < frames; ++i) {
    const Time start = time_from_ns(5'000'000'000) + kPeriod * i;
    FrameStamps stamps;
    stamps.device_ns = kDeviceStart + (kPeriod * i + stamp_after).count();
    stamps.first_packet = start + kExposure + kReadout + (i % 3) * 100us;
    stamps.arrival = stamps.first_packet + 4ms;
    times.stamp(stamps, result.info);
    result.error = std::chrono::abs(result.info.capture - (start + kExposure / 2));
  }
  return result;
}

TEST(AravisTimes, StampAtTheStartOfExposure) {
  const Result result = run({}, settings(), 0ms);
  EXPECT_LE(result.error, kReadout + 1ms);  // the read-out is not known
  EXPECT_LE(result.error, result.info.capture_error);
  EXPECT_LT(result.info.capture_error, kExposure + 2ms);
  EXPECT_EQ(result.info.device_clock, ClockLabel::kDevice);
}

TEST(AravisTimes, StampAtTheEndOfExposure) {
  AravisOptions options;
  options.stamp = ExposureStamp::kEnd;
  const Result result = run(options, settings(), kExposure);
  EXPECT_LE(result.error, result.info.capture_error);
  EXPECT_LT(result.info.capture_error, 6ms);
}

TEST(AravisTimes, AMeasuredWayMakesTheBoundSmall) {
  AravisOptions options;
  options.transit_us = 11'000;
  const Result result = run(options, settings(), 0ms);
  EXPECT_LE(result.error, 300us);
  EXPECT_LE(result.error, result.info.capture_error);
  EXPECT_LT(result.info.capture_error, 1ms);
}

TEST(AravisTimes, AutomaticExposureWidensTheBound) {
  AravisSettings automatic = settings();
  automatic.exposure_range_us = 40'000;
  const Duration fixed = run({}, settings(), 0ms).info.capture_error;
  EXPECT_EQ(run({}, automatic, 0ms).info.capture_error, fixed + 20ms);
}

TEST(AravisTimes, LatchesNeedNoMeasuredWay) {
  AravisTimes times({}, settings());
  const Time zero = time_from_ns(5'000'000'000);
  for (int second = 0; second < 5; ++second) {
    const Time at = zero + 1s * second;
    times.add({kDeviceStart + (at - zero).count(), at - 100us, at + 150us});
  }
  for (int i = 0; i < 50; ++i) {
    const Time start = zero + 5s + kPeriod * i;
    FrameInfo info;
    FrameStamps stamps{kDeviceStart + (start - zero).count(), start + kExposure + kReadout,
                       start + kExposure + kReadout + 4ms, 5000.0};
    times.stamp(stamps, info);
    EXPECT_TRUE(times.latched());
    // The exposure that came with the image, not the one that was set.
    EXPECT_LE(std::chrono::abs(info.capture - (start + 2500us)), info.capture_error);
    EXPECT_LT(info.capture_error, 500us);
  }
}

TEST(AravisTimes, LatchesOfAClockThatWasSetAreNotBelieved) {
  AravisTimes times({}, settings());
  const Time zero = time_from_ns(5'000'000'000);
  times.add({kDeviceStart, zero - 100us, zero + 100us});
  FrameInfo info;
  const Time start = zero + 100ms;
  times.stamp({kDeviceStart - 50'000'000'000 + 60'000'000'000'000,
               start + kExposure,
               start + kExposure + 4ms,
               {}},
              info);
  EXPECT_FALSE(times.latched());
  EXPECT_LE(std::chrono::abs(info.capture - (start + kExposure / 2)), info.capture_error);
}

TEST(AravisTimes, WithoutAUsableStampTheArrivalCounts) {
  AravisTimes times({}, settings());
  FrameInfo info;
  const Time packet = time_from_ns(5'000'000'000);
  times.stamp({0, packet, packet + 4ms, {}}, info);
  EXPECT_EQ(info.device_clock, ClockLabel::kNone);
  EXPECT_EQ(info.capture, packet - kExposure / 2);
  EXPECT_GE(info.capture_error, kPeriod);
  EXPECT_EQ(times.clock().rejected(), 1u);
}

TEST(AravisTimes, NeverAfterTheArrival) {
  AravisOptions options;
  options.transit_us = 0;  // wrong, and the whole frame comes before the middle of exposure
  AravisTimes times(options, settings());
  FrameInfo info;
  const Time packet = time_from_ns(5'000'000'000);
  times.stamp({kDeviceStart, packet, packet + 1ms, {}}, info);
  EXPECT_EQ(info.capture, info.arrival);
}

}  // namespace
}  // namespace sightline::capture
