// SPDX-License-Identifier: Apache-2.0
#include "capture/axes/v4l2_head.hpp"

#include <gtest/gtest.h>

#include <cerrno>
#include <cmath>
#include <numbers>

#include "capture/device_tree.hpp"
#include "simulated_ptz.hpp"

namespace sightline::capture {
namespace {

using namespace std::chrono_literals;
using test::SimulatedPtz;

constexpr double kDegree = std::numbers::pi / 180;

class V4l2HeadTest : public testing::Test {
 protected:
  V4l2HeadTest() { tree_.add(0, "Motor", "1-1", "A7"); }
  Result<std::unique_ptr<AxisSource>> open(HeadOrders orders = HeadOrders::kAny) {
    AxisSourceOptions options = *parse_axis_source("v4l2:serial:A7", "head");
    options.orders = orders;
    options.fastest = SimulatedPtz::kRate / 3600 * kDegree;
    return open_v4l2_head_in(options, "head", tree_.places(), ptz_);
  }
  /// Runs for a time; `order` is given anew every 45 ms, as a follower does.
  AxisReading run(AxisSource& head, Duration time, const std::optional<HeadOrder>& order = {}) {
    AxisReading last;
    Time next{};
    for (const Time end = ptz_->now() + time; ptz_->now() < end;) {
      if (order && ptz_->now() >= next) {
        head.turn(*order);
        next = ptz_->now() + 45ms;
      }
      const auto reading = head.next(25ms);
      EXPECT_TRUE(reading.has_value());
      if (!reading) return last;
      if (*reading) last = **reading;
    }
    return last;
  }

  test::DeviceTree tree_;
  std::shared_ptr<SimulatedPtz> ptz_ = std::make_shared<SimulatedPtz>();
};

TEST_F(V4l2HeadTest, AnglesAreArcSecondsAndStampedHalfway) {
  auto head = open();
  ASSERT_TRUE(head.has_value()) << head.error().message();
  ptz_->transfer = 20ms;
  const Time before = ptz_->now();
  const auto reading = (*head)->next(25ms);
  ASSERT_TRUE(reading.has_value() && reading->has_value());
  EXPECT_EQ((*reading)->stamp, before + 10ms);
  EXPECT_EQ((*reading)->zoom, 100);
  const AxisReading there = run(**head, 5s, HeadOrder{{10 * kDegree, -5 * kDegree}, {1, 1}});
  EXPECT_NEAR(there.pan, 10 * kDegree, 1e-9);
  EXPECT_NEAR(there.tilt, -5 * kDegree, 1e-9);
  EXPECT_GT((*head)->counts().good, 50u);
  EXPECT_EQ((*head)->counts().refused, 0u);
}

TEST_F(V4l2HeadTest, OrdersKeepToItsEndsAndSteps) {
  auto head = open();
  ASSERT_TRUE(head.has_value());
  for (const HeadAngles& place :
       {HeadAngles(0.31, 0.17), HeadAngles(9, -9), HeadAngles(-9, 9), HeadAngles(1e-3, -1e-3)}) {
    run(**head, 1s, HeadOrder{place, {1, 1}});
  }
  EXPECT_EQ((*head)->counts().refused, 0u);
  EXPECT_GE(ptz_->orders().size(), 8u);
  ptz_->controls[V4L2_CID_PAN_ABSOLUTE] = {-1000, 1050, 100};  // its last step is not whole
  ptz_->controls[V4L2_CID_TILT_ABSOLUTE] = {-1000, 1050, 100};
  auto other = open();
  ASSERT_TRUE(other.has_value());
  run(**other, 1s, HeadOrder{{1, 1}, {1, 1}});
  EXPECT_EQ((*other)->counts().refused, 0u);
  EXPECT_EQ(ptz_->orders().back().second, 1000);
}

TEST_F(V4l2HeadTest, WhatIsSetIsNotSetAgainAndAgain) {
  auto head = open();
  ASSERT_TRUE(head.has_value());
  run(**head, 3s, HeadOrder{{0.2, 0}, {1, 1}});
  EXPECT_LE(ptz_->orders().size(), 2u * 8);
}

TEST_F(V4l2HeadTest, ByRatesItTurnsAsOrderedAndStopsByItself) {
  for (const char* why : {"chosen", "no places can be set"}) {
    ptz_ = std::make_shared<SimulatedPtz>();
    const bool chosen = std::string(why) == "chosen";
    if (!chosen) {
      ptz_->controls[V4L2_CID_PAN_ABSOLUTE].flags = V4L2_CTRL_FLAG_READ_ONLY;
      ptz_->controls[V4L2_CID_TILT_ABSOLUTE].flags = V4L2_CTRL_FLAG_READ_ONLY;
    }
    auto head = open(chosen ? HeadOrders::kContinuous : HeadOrders::kAny);
    ASSERT_TRUE(head.has_value());
    run(**head, 100ms);
    const double rate = SimulatedPtz::kRate / 3600 * kDegree / 2;
    const AxisReading turned = run(**head, 1s, HeadOrder{{2, -1}, {rate, -rate}});
    EXPECT_NEAR(turned.pan, rate, 0.1 * rate) << why;
    EXPECT_NEAR(turned.tilt, -rate, 0.1 * rate) << why;
    EXPECT_TRUE(ptz_->turns());
    run(**head, from_seconds(AxisDrive::kAhead) + 100ms);  // nobody orders any more
    EXPECT_FALSE(ptz_->turns());
    const double stopped = ptz_->pan();
    run(**head, 1s);
    EXPECT_EQ(ptz_->pan(), stopped);
    EXPECT_EQ((*head)->counts().refused, 0u);
  }
}

TEST_F(V4l2HeadTest, ByRatesItDoesNotTurnThroughThePlace) {
  auto head = open(HeadOrders::kContinuous);
  ASSERT_TRUE(head.has_value());
  run(**head, 100ms);
  run(**head, 3s, HeadOrder{{3 * kDegree, 0}, {0.1, 0}});
  EXPECT_FALSE(ptz_->turns());
  EXPECT_NEAR(ptz_->pan(), 3 * 3600, 0.5 * 3600);
}

TEST_F(V4l2HeadTest, AHeadThatIsLeftTurningIsStopped) {
  auto head = open(HeadOrders::kContinuous);
  ASSERT_TRUE(head.has_value());
  run(**head, 100ms);
  run(**head, 200ms, HeadOrder{{2, 0}, {0.1, 0}});
  EXPECT_TRUE(ptz_->turns());
  head->reset();
  EXPECT_FALSE(ptz_->turns());
  EXPECT_EQ(ptz_->open_files(), 0);
}

TEST_F(V4l2HeadTest, AMissingControlIsNamed) {
  ptz_->controls.erase(V4L2_CID_TILT_ABSOLUTE);
  auto head = open();
  ASSERT_FALSE(head.has_value());
  EXPECT_EQ(head.error().code, ErrorCode::kInvalidInput);
  EXPECT_NE(head.error().message().find("it has no tilt_absolute"), std::string::npos)
      << head.error().message();
  EXPECT_NE(head.error().message().find("it has pan_absolute, pan_speed"), std::string::npos);
  ptz_->controls[V4L2_CID_TILT_ABSOLUTE] = {-10, 10, 1, V4L2_CTRL_FLAG_WRITE_ONLY};
  EXPECT_FALSE(open().has_value());
  EXPECT_EQ(ptz_->open_files(), 0);
}

TEST_F(V4l2HeadTest, WhatCannotBeTurnedRefusesOrdersAndIsRead) {
  for (const uint32_t id : {V4L2_CID_PAN_ABSOLUTE, V4L2_CID_TILT_ABSOLUTE}) {
    ptz_->controls[id].flags = V4L2_CTRL_FLAG_READ_ONLY;
  }
  ptz_->controls.erase(V4L2_CID_PAN_SPEED);
  ptz_->controls.erase(V4L2_CID_ZOOM_ABSOLUTE);
  auto head = open();
  ASSERT_TRUE(head.has_value());
  run(**head, 1s, HeadOrder{{1, 0}, {1, 0}});
  EXPECT_TRUE(ptz_->orders().empty());
  EXPECT_GT((*head)->counts().refused, 5u);
  EXPECT_GT((*head)->counts().good, 5u);
}

TEST_F(V4l2HeadTest, FaultsEndIt) {
  auto head = open();
  ASSERT_TRUE(head.has_value());
  run(**head, 100ms);
  ptz_->failures[VIDIOC_S_EXT_CTRLS] = EIO;
  run(**head, 1s, HeadOrder{{1, 0}, {1, 0}});
  EXPECT_GT((*head)->counts().refused, 0u);
  ptz_->failures[VIDIOC_G_EXT_CTRLS] = EIO;
  std::string text;
  for (int i = 0; i < 20 && text.empty(); ++i) {
    const auto reading = (*head)->next(25ms);
    if (!reading) text = reading.error().message();
  }
  EXPECT_NE(text.find("cannot read a control of"), std::string::npos) << text;
  EXPECT_EQ((*head)->counts().bad, 5u);
  ptz_->failures[VIDIOC_G_EXT_CTRLS] = ENODEV;  // unplugged: at once
  auto gone = open();
  ASSERT_TRUE(gone.has_value());
  EXPECT_FALSE((*gone)->next(25ms).has_value());
}

TEST_F(V4l2HeadTest, AnotherCameraIsNotTaken) {
  AxisSourceOptions options = *parse_axis_source("v4l2:serial:B9", "head");
  const auto head = open_v4l2_head_in(options, "head", tree_.places(), ptz_);
  ASSERT_FALSE(head.has_value());
  EXPECT_EQ(head.error().code, ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace sightline::capture
