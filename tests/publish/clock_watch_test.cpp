// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/cell/clock_watch.hpp"

#include <gtest/gtest.h>

namespace sightline {
namespace {

using namespace std::chrono_literals;

constexpr int64_t kOffset = 1'700'000'000'000'000'000;

TEST(ClockWatch, TimesGoThereAndBack) {
  ClockWatch clock(1ms, 10ms);
  EXPECT_FALSE(clock.note(Time(5s), kOffset, 1us));
  EXPECT_EQ(clock.utc_ns_of(Time(0s)), kOffset - 5'000'000'000);
  EXPECT_EQ(clock.time_of(clock.utc_ns_of(Time(123456789ns))), Time(123456789ns));
}

TEST(ClockWatch, JitterOfTheReadingIsNoStep) {
  ClockWatch clock(1ms, 10ms);
  clock.note(Time(5s), kOffset + 5'000'000'000, 1us);
  EXPECT_FALSE(clock.note(Time(6s), kOffset + 6'000'300'000, 1us));
  EXPECT_FALSE(clock.note(Time(7s), kOffset + 7'004'000'000, 5ms));  // held up in between
  EXPECT_EQ(clock.steps(), 0U);
  EXPECT_EQ(clock.utc_ns_of(Time(0s)), kOffset);
}

TEST(ClockWatch, AStepIsNoticedAndTheClockNotFitForAWhile) {
  ClockWatch clock(1ms, 10ms);
  clock.note(Time(5s), kOffset + 5'000'000'000, 1us);
  EXPECT_TRUE(clock.state(Time(5s)).fit);
  EXPECT_TRUE(clock.note(Time(6s), kOffset + 6'003'000'000, 1us));
  EXPECT_EQ(clock.steps(), 1U);
  EXPECT_EQ(clock.utc_ns_of(Time(0s)), kOffset + 3'000'000);
  EXPECT_FALSE(clock.state(Time(7s)).fit);
  EXPECT_EQ(clock.state(Time(7s)).text, "has just been set anew");
  EXPECT_TRUE(clock.state(Time(6s) + ClockWatch::kAfterStep).fit);
}

TEST(ClockWatch, TheTimeServiceSaysHowGoodItIs) {
  ClockWatch clock(1ms, 10ms);
  clock.set_service(20us, "");
  EXPECT_EQ(clock.state(Time(0s)).bound, 20us);
  EXPECT_EQ(clock.state(Time(0s)).text, "chrony");
  clock.set_service(30ms, "");
  EXPECT_FALSE(clock.state(Time(0s)).fit);
  EXPECT_EQ(clock.state(Time(0s)).text, "may be 30.0 ms off, 10.0 are allowed");
  clock.set_service(std::nullopt, "chrony is in step with no server");
  EXPECT_FALSE(clock.state(Time(0s)).fit);
  clock.set_service(std::nullopt, "");
  EXPECT_TRUE(clock.state(Time(0s)).fit);
  EXPECT_EQ(clock.state(Time(0s)).bound, 1ms);
}

TEST(ChronyBound, AddsWhatMayBeWrong) {
  const auto bound = chrony_bound(
      "C0A80001,192.168.0.1,3,1700000000.1,-0.000020,0.000001,0.000010,-5.2,0.001,0.02,0.000400,"
      "0.000300,64.2,Normal\n");
  ASSERT_TRUE(bound);
  EXPECT_EQ(*bound, 520us);
}

TEST(ChronyBound, RefusesWhatIsNoAnswer) {
  for (const char* line :
       {"", "506 Cannot talk to daemon\n", "7F7F0101,,0,0,0,0,0,0,0,0,1,1,0,Normal",
        "00000000,,3,0,0,0,0,0,0,0,1,1,0,Not in step", "a,b,3,0,x,0,0,0,0,0,1,1,0,Normal",
        "a,b,3,0,nan,0,0,0,0,0,1,1,0,Normal", "a,b,3,0,0,0,0,0,0,0,-1,1,0,Normal"}) {
    EXPECT_FALSE(chrony_bound(line)) << line;
  }
}

}  // namespace
}  // namespace sightline
