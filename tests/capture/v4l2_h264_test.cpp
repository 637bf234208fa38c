// SPDX-License-Identifier: Apache-2.0
// H.264 cameras: streams of x264 through a scripted device and the decoder.
#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <chrono>
#include <cmath>
#include <thread>

#include "capture/common/gst_ref.hpp"
#include "capture/decode/h264_decoder.hpp"
#include "capture/v4l2/v4l2_open.hpp"
#include "device_tree.hpp"
#include "scripted_v4l2.hpp"
#include "support/matchers.hpp"

namespace sightline::capture {
namespace {

using namespace std::chrono_literals;
using test::FailsWith;
using test::IsOk;
using test::ScriptedV4l2;

constexpr int kWidth = 64, kHeight = 48, kKeyInterval = 10;
using Units = std::vector<std::vector<uint8_t>>;

uint8_t luma_of(size_t image) { return static_cast<uint8_t>(40 + 5 * image); }

/// Flat images of growing brightness; empty without an encoder.
Units encoded(size_t count, int width = kWidth) {
  gst_init(nullptr, nullptr);
  const std::string line =
      "appsrc name=in format=time caps=video/x-raw,format=I420,framerate=25/1,height=48,width=" +
      std::to_string(width) + " ! x264enc tune=zerolatency option-string=scenecut=0 key-int-max=" +
      std::to_string(kKeyInterval) +
      " bitrate=500 ! video/x-h264,stream-format=byte-stream,alignment=au,profile=baseline ! "
      "appsink name=out sync=false";
  const GstRef<GstElement> pipeline(
      gst_parse_launch_full(line.c_str(), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, nullptr));
  if (!pipeline) return {};
  const GstRef<GstElement> in(gst_bin_get_by_name(GST_BIN(pipeline.get()), "in"));
  const GstRef<GstElement> out(gst_bin_get_by_name(GST_BIN(pipeline.get()), "out"));
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const auto luma_bytes = static_cast<size_t>(width) * kHeight;
  for (size_t i = 0; i < count; ++i) {
    GstBuffer* const buffer = gst_buffer_new_allocate(nullptr, luma_bytes * 3 / 2, nullptr);
    gst_buffer_memset(buffer, 0, luma_of(i), luma_bytes);
    gst_buffer_memset(buffer, luma_bytes, 128, luma_bytes / 2);
    GST_BUFFER_PTS(buffer) = i * 40 * GST_MSECOND;
    gst_app_src_push_buffer(GST_APP_SRC(in.get()), buffer);
  }
  gst_app_src_end_of_stream(GST_APP_SRC(in.get()));
  Units units;
  while (units.size() < count) {
    const GstRef<GstSample> sample(
        gst_app_sink_try_pull_sample(GST_APP_SINK(out.get()), 10 * GST_SECOND));
    if (!sample) break;
    const MappedBuffer bytes(gst_sample_get_buffer(sample.get()));
    units.emplace_back(bytes.data(), bytes.data() + bytes.size());
  }
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  return units;
}

class V4l2H264Test : public testing::Test {
 protected:
  void SetUp() override {
    units_ = encoded(30);
    if (units_.size() != 30) GTEST_SKIP() << "no x264enc (gstreamer1.0-plugins-ugly)";
    tree_.add(0, "Scripted camera", "1-2", "A0");
    options_.device = tree_.dev("video0");
    options_.counters = counters_;
    device_->modes = {{V4L2_PIX_FMT_H264, kWidth, kHeight, {25}}};
    auto source = open_v4l2_source_in(options_, CameraId(3), "left", tree_.places(), device_);
    ASSERT_THAT(source, IsOk());
    source_ = *std::move(source);
  }
  /// The next frame; waits for the decoder's threads, ten seconds at most.
  FramePtr frame() {
    for (int i = 0; i < 200; ++i) {
      const auto step = source_->next({}, 1ms);  // on the device's clock
      EXPECT_THAT(step, IsOk());
      if (!step || step->frame) return step ? step->frame : nullptr;
      std::this_thread::sleep_for(50ms);
    }
    return nullptr;
  }
  void expect_image(const FramePtr& got, size_t number) {
    ASSERT_NE(got, nullptr) << "image " << number;
    const double middle = got->i420().y.row(kHeight / 2)[kWidth / 2];
    EXPECT_NEAR(middle, luma_of(number), 2) << "image " << number;
  }

  Units units_;
  test::DeviceTree tree_;
  std::shared_ptr<ScriptedV4l2> device_ = std::make_shared<ScriptedV4l2>();
  std::shared_ptr<CaptureCounters> counters_ = std::make_shared<CaptureCounters>();
  V4l2Options options_;
  std::unique_ptr<FrameSource> source_;
};

TEST_F(V4l2H264Test, EveryUnitGivesItsImageWithItsOwnTime) {
  Time last{};
  for (size_t i = 0; i < units_.size(); ++i) {
    device_->send(units_[i]);
    const FramePtr got = frame();
    expect_image(got, i);
    if (got == nullptr) return;
    EXPECT_EQ(got->info().sequence, i);
    EXPECT_EQ(got->info().format, PixelFormat::kI420);
    EXPECT_GT(got->info().capture, last);
    last = got->info().capture;
    EXPECT_EQ(device_->queued(), 4u) << "the driver has its buffer back";
  }
  EXPECT_EQ(counters_->good.value(), units_.size());
  EXPECT_EQ(counters_->damaged.value(), 0u);
}

TEST_F(V4l2H264Test, BeginsAtAKeyFrame) {
  for (size_t i = 5; i <= kKeyInterval; ++i) device_->send(units_[i]);
  expect_image(frame(), kKeyInterval);
  EXPECT_EQ(counters_->damaged.value(), 0u);
}

TEST_F(V4l2H264Test, GarbageIsNeverShownAsAnImageAndTheNextKeyFrameHeals) {
  auto garbage = units_[5];
  for (size_t i = 5; i < garbage.size(); ++i) garbage[i] = static_cast<uint8_t>(i * 37);
  for (size_t i = 0; i < units_.size(); ++i) device_->send(i == 5 ? garbage : units_[i]);
  uint64_t last = 0;
  uint64_t dropped = 0;
  while (last + 1 < units_.size()) {
    const FramePtr got = frame();
    ASSERT_NE(got, nullptr) << "after image " << last;
    last = got->info().sequence;
    dropped += got->info().dropped_before;
    if (last < 5 || last >= kKeyInterval) expect_image(got, last);
  }
  EXPECT_EQ(counters_->good.value() + counters_->damaged.value(), units_.size());
  EXPECT_EQ(counters_->damaged.value(), dropped);
}

TEST_F(V4l2H264Test, ImagesOfAnotherSizeEndTheSource) {
  const Units other = encoded(1, 2 * kWidth);
  ASSERT_EQ(other.size(), 1u);
  device_->send(other[0]);
  for (int i = 0; i < 200; ++i) {
    const auto step = source_->next({}, 1ms);
    if (!step) {
      EXPECT_THAT(step, FailsWith("128x48 images, 64x48 were agreed on"));
      return;
    }
    std::this_thread::sleep_for(50ms);
  }
  FAIL() << "an image of another size went unnoticed";
}

}  // namespace
}  // namespace sightline::capture
