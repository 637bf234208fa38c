// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <chrono>
#include <memory>
#include <stop_token>
#include <vector>

#include "capture/v4l2/v4l2_open.hpp"
#include "device_tree.hpp"
#include "scripted_v4l2.hpp"
#include "support/matchers.hpp"

namespace sightline::capture {

inline constexpr uint32_t kWidth = 32, kHeight = 16;

inline std::vector<uint8_t> noise(size_t size, uint32_t seed = 1) {
  std::vector<uint8_t> bytes(size);
  for (uint8_t& byte : bytes) {
    seed = seed * 1664525u + 1013904223u;
    byte = static_cast<uint8_t>(seed >> 24);
  }
  return bytes;
}

class V4l2SourceTest : public testing::Test {
 protected:
  V4l2SourceTest() {
    tree_.add(0, "Scripted camera", "1-2", "A0");
    options_.device = tree_.dev("video0");
    options_.counters = counters_;
    use(V4L2_PIX_FMT_YUYV);
  }

  void use(uint32_t fourcc) { device_->modes = {{fourcc, kWidth, kHeight, {25, 50}}}; }
  Result<std::unique_ptr<FrameSource>> try_open() {
    return open_v4l2_source_in(options_, CameraId(3), "left", tree_.places(), device_,
                               stop_.get_token());
  }
  void open() {
    source_.reset();
    auto source = try_open();
    ASSERT_THAT(source, test::IsOk());
    source_ = *std::move(source);
  }
  size_t frame_bytes() const { return kWidth * kHeight * 2; }
  Result<SourceStep> next(Duration timeout = std::chrono::seconds(10)) {
    return source_->next({}, timeout);
  }
  FramePtr frame() {
    auto step = next();
    EXPECT_THAT(step, test::IsOk());
    return step && step->kind == SourceStep::Kind::kFrame ? step->frame : nullptr;
  }

  test::DeviceTree tree_;
  std::shared_ptr<test::ScriptedV4l2> device_ = std::make_shared<test::ScriptedV4l2>();
  std::shared_ptr<CaptureCounters> counters_ = std::make_shared<CaptureCounters>();
  V4l2Options options_;
  std::stop_source stop_;  ///< of the opening
  std::unique_ptr<FrameSource> source_;
};

}  // namespace sightline::capture
