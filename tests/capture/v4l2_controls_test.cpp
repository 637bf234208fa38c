// SPDX-License-Identifier: Apache-2.0
#include <string>

#include "sightline/base/waiting.hpp"
#include "v4l2_source_fixture.hpp"

namespace sightline::capture {
namespace {

using test::FailsWith;

class Controls : public V4l2SourceTest {
 protected:
  Controls() {
    device_->controls = {
        {V4L2_CID_BRIGHTNESS, "Brightness", V4L2_CTRL_TYPE_INTEGER, -64, 64, 0},
        {V4L2_CID_AUTO_WHITE_BALANCE, "White Balance, Automatic", V4L2_CTRL_TYPE_BOOLEAN, 0, 1, 1},
        {V4L2_CID_POWER_LINE_FREQUENCY,
         "Power Line Frequency",
         V4L2_CTRL_TYPE_MENU,
         0,
         2,
         2,
         {"Disabled", "50 Hz", "60 Hz"}},
        {V4L2_CID_EXPOSURE_AUTO,
         "Auto Exposure",
         V4L2_CTRL_TYPE_MENU,
         0,
         3,
         3,
         {"", "Manual Mode", "", "Aperture Priority Mode"}},
        {V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure Time, Absolute", V4L2_CTRL_TYPE_INTEGER, 1, 5000,
         156},
        {V4L2_CID_EXPOSURE_AUTO_PRIORITY, "Exposure, Dynamic Framerate", V4L2_CTRL_TYPE_BOOLEAN, 0,
         1, 1},
    };
  }
  int value(uint32_t id) const {
    for (const auto& control : device_->controls) {
      if (control.id == id) return control.value;
    }
    return -1;
  }
};

TEST_F(Controls, AreSetByNameSwitchesFirst) {
  options_.controls = {{"exposure_time_absolute", int64_t{80}},
                       {"auto_exposure", "manual_mode"},
                       {"power_line_frequency", "50 Hz"},
                       {"white_balance_automatic", "off"},
                       {"brightness", int64_t{-10}}};
  open();
  EXPECT_EQ(value(V4L2_CID_EXPOSURE_ABSOLUTE), 80);
  EXPECT_EQ(value(V4L2_CID_EXPOSURE_AUTO), 1);
  EXPECT_EQ(value(V4L2_CID_POWER_LINE_FREQUENCY), 1);
  EXPECT_EQ(value(V4L2_CID_AUTO_WHITE_BALANCE), 0);
  EXPECT_EQ(value(V4L2_CID_BRIGHTNESS), -10);
}

TEST_F(Controls, AutomaticExposureMayNotLowerTheRateUnlessAsked) {
  open();
  EXPECT_EQ(value(V4L2_CID_EXPOSURE_AUTO_PRIORITY), 0);
  options_.controls = {{"exposure_dynamic_framerate", int64_t{1}}};
  open();
  EXPECT_EQ(value(V4L2_CID_EXPOSURE_AUTO_PRIORITY), 1);
}

TEST_F(Controls, WhatTheCameraChangesIsReadBack) {
  device_->controls[0].driver_limit = 20;
  options_.controls = {{"brightness", int64_t{50}}};
  testing::internal::CaptureStderr();
  open();
  EXPECT_NE(testing::internal::GetCapturedStderr().find(
                "control 'brightness' is 20 after it was set to 50"),
            std::string::npos);
}

TEST_F(Controls, AStopIsSeenBetweenTwoThatTakeTheirTime) {
  options_.controls = {{"brightness", int64_t{20}},
                       {"power_line_frequency", "50 Hz"},
                       {"white_balance_automatic", "off"}};
  int set = 0;
  device_->on_call = [&](unsigned long request) {
    if (request != VIDIOC_S_EXT_CTRLS) return;
    ++set;
    stop_.request_stop();
  };
  EXPECT_THAT(try_open(), FailsWith("stopped while the camera was being opened"));
  EXPECT_EQ(set, 1);
  EXPECT_EQ(device_->open_files(), 0);
}

/// What a thread waits for, as its watcher sees it.
class Listener final : public WaitListener {
 public:
  void wait_begins(const char* what) override { what_ = what; }
  void wait_ends() override { what_.clear(); }
  const std::string& what() const { return what_; }

 private:
  std::string what_;
};

TEST_F(Controls, EveryCallOfTheDriverIsAWaitForTheCamera) {
  Listener listener;
  const WaitListening listening(listener);
  options_.controls = {{"brightness", int64_t{20}}};
  size_t calls = 0;
  device_->on_call = [&](unsigned long request) {
    ++calls;
    EXPECT_EQ(listener.what(), "the camera") << "request " << request;
  };
  open();
  EXPECT_EQ(listener.what(), "");
  const size_t opening = calls;
  device_->send(noise(frame_bytes()));
  ASSERT_TRUE(frame());
  source_.reset();
  EXPECT_GT(opening, 10u);
  EXPECT_GT(calls, opening);
  EXPECT_EQ(listener.what(), "");
}

TEST_F(Controls, MistakesNameWhatThereIs) {
  options_.controls = {{"focus", int64_t{1}}};
  EXPECT_THAT(try_open(), FailsWith("has no control 'focus'; it has: brightness, "));
  options_.controls = {{"brightness", int64_t{65}}};
  EXPECT_THAT(try_open(), FailsWith("takes -64..64, not 65"));
  options_.controls = {{"brightness", "bright"}};
  EXPECT_THAT(try_open(), FailsWith("takes a number, not 'bright'"));
  options_.controls = {{"power_line_frequency", "55 Hz"}};
  EXPECT_THAT(try_open(), FailsWith("has no entry '55 Hz'; it has: disabled, 50_hz, 60_hz"));
  options_.controls = {{"exposure_time_absolute", int64_t{80}}};
  EXPECT_THAT(try_open(), FailsWith("switched off by an automatic mode"));
}

}  // namespace
}  // namespace sightline::capture
