// SPDX-License-Identifier: Apache-2.0
// Library objects that hang when they are to be closed.
#include "capture/common/background_close.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <latch>
#include <thread>

#include "sightline/capture/network/network_source.hpp"

namespace sightline::capture {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// Until `name` has no more than `count` of them.
bool eventually(const BackgroundCloses& closes, const std::string& name, size_t count) {
  const Time end = MonotonicClock::now() + 60s;
  while (closes.pending(name) > count) {
    if (MonotonicClock::now() > end) return false;
    std::this_thread::sleep_for(5ms);
  }
  return true;
}

TEST(BackgroundCloses, OneThatEndsIsWaitedForAndNotHurried) {
  BackgroundCloses closes;
  bool closed = false, hurried = false;
  EXPECT_TRUE(closes.run(
      "cam", [&] { closed = true; }, 60s, [&] { hurried = true; }));
  EXPECT_TRUE(closed);
  EXPECT_FALSE(hurried);
  EXPECT_EQ(closes.pending("cam"), 0u);
}

TEST(BackgroundCloses, OneThatHangsIsHurriedThenLeftAndCounted) {
  BackgroundCloses closes;
  std::latch end(1);
  int hurried = 0;
  EXPECT_FALSE(closes.run(
      "cam", [&] { end.wait(); }, 5ms, [&] { ++hurried; }));
  EXPECT_EQ(hurried, 1);
  EXPECT_EQ(closes.pending("cam"), 1u);
  EXPECT_EQ(closes.pending("other"), 0u);
  end.count_down();
  EXPECT_TRUE(eventually(closes, "cam", 0));
}

TEST(BackgroundCloses, WhatIsClosedGoesInItsThreadAndNotInTheCallers) {
  BackgroundCloses closes;
  std::latch end(1);
  std::shared_ptr<int> held(new int, [&](int* number) {
    end.wait();
    delete number;
  });
  auto close = [held = std::move(held)]() mutable { held.reset(); };
  EXPECT_FALSE(closes.run("cam", std::move(close), 5ms, [] {}));
  end.count_down();
  EXPECT_TRUE(eventually(closes, "cam", 0));
}

TEST(BackgroundCloses, OneThatEndsWhenItIsHurriedIsNotLeft) {
  BackgroundCloses closes;
  std::latch end(1);
  EXPECT_TRUE(closes.run(
      "cam", [&] { end.wait(); }, 1s, [&] { end.count_down(); }));
  EXPECT_EQ(closes.pending("cam"), 0u);
}

TEST(NetworkSource, IsNotOpenedWhileThreeOfItsNameHang) {
  BackgroundCloses& closes = BackgroundCloses::of_process();
  NetworkOptions options;
  options.url = "rtsp://127.0.0.1:1/video";
  std::latch end(1);
  for (int i = 0; i < 3; ++i) {
    EXPECT_TRUE(open_network_source(options, CameraId(0), "hung")) << i << " hang";
    ASSERT_TRUE(eventually(closes, "hung", static_cast<size_t>(i)));  // its own close is over
    EXPECT_FALSE(closes.run(
        "hung", [&] { end.wait(); }, 1ms, [] {}));
  }
  const auto refused = open_network_source(options, CameraId(0), "hung");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(refused.error().text, HasSubstr("has not let go of 3 earlier connections"));
  EXPECT_TRUE(open_network_source(options, CameraId(0), "another"));
  end.count_down();
  ASSERT_TRUE(eventually(closes, "hung", 0));
  EXPECT_TRUE(open_network_source(options, CameraId(0), "hung"));
}

}  // namespace
}  // namespace sightline::capture
