// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <deque>
#include <vector>

#include "capture/libcamera/libcamera_formats.hpp"
#include "capture/libcamera/libcamera_open.hpp"
#include "jpeg_maker.hpp"
#include "sightline/image/convert.hpp"
#include "support/allocations.hpp"
#include "support/matchers.hpp"

namespace sightline::capture {
namespace {

using namespace std::chrono_literals;
using test::FailsWith;
using test::IsOk;

constexpr int kWidth = 32, kHeight = 16;
constexpr size_t kYuyvBytes = size_t{2} * kWidth * kHeight;
constexpr Duration kPeriod = 40ms;

std::vector<uint8_t> noise(size_t size, uint32_t seed = 1) {
  std::vector<uint8_t> bytes(size);
  for (uint8_t& byte : bytes) {
    seed = seed * 1664525u + 1013904223u;
    byte = static_cast<uint8_t>(seed >> 24);
  }
  return bytes;
}

/// A camera that follows a script, on a clock of its own: nothing sleeps.
class ScriptedCamera final : public BufferDevice {
 public:
  struct Buffer {
    std::vector<uint8_t> bytes;
    bool good = true;
    uint32_t advance = 1;
    std::optional<int64_t> sensor_ns = std::nullopt;  // default: a millisecond ago
    int64_t exposure_ns = 0;
  };

  explicit ScriptedCamera(std::string_view format) : memory_(4, std::vector<uint8_t>(kYuyvBytes)) {
    stream_ = *stream_format(*find_libcamera_format(format), kWidth, kHeight, 0);
    stream_.layout.rate_hz = 25;
  }

  std::deque<Buffer> script;
  std::vector<size_t> queued;
  bool gone = false, refuses = false, stopped = false;
  Duration asleep{0};
  Status start_status{};

  bool owns(const uint8_t* p) const {
    return std::any_of(memory_.begin(), memory_.end(),
                       [p](const auto& m) { return p >= m.data() && p < m.data() + m.size(); });
  }

  const StreamFormat& stream() const { return stream_; }

  std::string description() const override { return "\\_SB_.PCI0-1:1.0-0bda:58f4"; }
  size_t buffer_count() const override { return memory_.size(); }
  std::span<const uint8_t> memory(size_t index) const override { return memory_[index]; }
  int dmabuf_fd(size_t index) const override { return 100 + static_cast<int>(index); }
  Status start() override {
    for (size_t index = 0; index < memory_.size(); ++index) queued.push_back(index);
    return start_status;
  }
  Status queue(size_t index) override {
    EXPECT_FALSE(stopped) << "queued after stop()";
    if (refuses) return make_error(ErrorCode::kIo, "left", "cannot go on");
    queued.push_back(index);
    return {};
  }
  Result<std::optional<FilledBuffer>> dequeue(Duration limit) override {
    if (gone) return make_error(ErrorCode::kUnavailable, "left", "the camera is gone");
    if (script.empty() || queued.empty()) {
      now_ += limit;
      return std::optional<FilledBuffer>();
    }
    now_ += kPeriod;
    const Buffer& next = script.front();
    CompletedRequest request;
    request.buffer = queued.front();
    queued.erase(queued.begin());
    request.good = next.good;
    request.bytes = next.bytes.size();
    request.sequence = sequence_ += next.advance;
    request.sensor_ns = next.sensor_ns.value_or(to_ns(now_ - 1ms));
    request.exposure_ns = next.exposure_ns;
    std::memcpy(memory_[request.buffer].data(), next.bytes.data(), next.bytes.size());
    script.pop_front();
    return std::optional(filled_buffer(request, now_, asleep));
  }
  void stop() override { stopped = true; }
  Time now() const override { return now_; }

 private:
  StreamFormat stream_;
  std::vector<std::vector<uint8_t>> memory_;
  uint32_t sequence_ = 6;
  Time now_ = time_from_ns(1'000'000'000'000);
};

class LibcameraSourceTest : public testing::Test {
 protected:
  void open(std::string_view format = "YUYV") {
    device_ = std::make_shared<ScriptedCamera>(format);
    options_.counters = counters_;
    auto source =
        open_libcamera_source_on(device_, device_->stream(), options_, CameraId(3), "left");
    ASSERT_THAT(source, IsOk());
    source_ = *std::move(source);
  }
  void send(std::vector<uint8_t> bytes) { device_->script.push_back({std::move(bytes)}); }
  FramePtr frame() {
    auto step = source_->next({}, 100ms);
    EXPECT_THAT(step, IsOk());
    return step ? step->frame : nullptr;
  }
  /// What next() ends with, after at most ten seconds.
  Error failure() {
    for (int i = 0; i < 100; ++i) {
      auto step = source_->next({}, 100ms);
      if (!step) return step.error();
    }
    ADD_FAILURE() << "still waiting";
    return {};
  }

  std::shared_ptr<ScriptedCamera> device_;
  std::shared_ptr<CaptureCounters> counters_ = std::make_shared<CaptureCounters>();
  LibcameraOptions options_;
  std::unique_ptr<FrameSource> source_;
};

TEST(LibcameraFormats, HaveTheirImagesByOtherNames) {
  const auto fourcc = [](std::string_view name) {
    const FourccFormat* const format = find_libcamera_format(name);
    return format != nullptr ? format->fourcc : 0;
  };
  EXPECT_EQ(fourcc("YUYV"), V4L2_PIX_FMT_YUYV);
  EXPECT_EQ(fourcc("MJPEG"), V4L2_PIX_FMT_MJPEG);
  EXPECT_EQ(fourcc("R8"), V4L2_PIX_FMT_GREY);
  EXPECT_EQ(fourcc("R10"), V4L2_PIX_FMT_Y10);
  EXPECT_EQ(fourcc("RGB888"), V4L2_PIX_FMT_BGR24);
  EXPECT_EQ(fourcc("BGR888"), V4L2_PIX_FMT_RGB24);
  EXPECT_EQ(fourcc("SGBRG12_CSI2P"), V4L2_PIX_FMT_SGBRG12P);
  EXPECT_EQ(fourcc("SRGGB16"), V4L2_PIX_FMT_SRGGB16);
  EXPECT_EQ(fourcc("XRGB8888"), 0u);
  EXPECT_EQ(fourcc(""), 0u);
}

TEST_F(LibcameraSourceTest, FramesAreTheCamerasOwnBuffersByteForByte) {
  open();
  const auto sent = noise(kYuyvBytes);
  send(sent);
  const FramePtr got = frame();
  ASSERT_NE(got, nullptr);
  EXPECT_TRUE(device_->owns(got->payload().bytes.data()));
  EXPECT_TRUE(std::equal(sent.begin(), sent.end(), got->payload().bytes.begin(),
                         got->payload().bytes.end()));
  EXPECT_GE(got->payload().dmabuf_fd, 100);
  EXPECT_EQ(got->info().camera, CameraId(3));
  EXPECT_EQ(got->info().format, PixelFormat::kYuyv);
  EXPECT_EQ(source_->info().nominal_rate_hz, 25);
}

TEST_F(LibcameraSourceTest, RequestsGoRoundWithTheLastReader) {
  open();
  send(noise(kYuyvBytes));
  FramePtr first = frame();
  EXPECT_EQ(device_->queued.size(), 3u);
  FramePtr second_reader = first;
  first.reset();
  EXPECT_EQ(device_->queued.size(), 3u);
  second_reader.reset();
  EXPECT_EQ(device_->queued.size(), 4u);
}

TEST_F(LibcameraSourceTest, AReaderThatHoldsTooMuchGetsCopies) {
  open();
  std::vector<FramePtr> held;
  for (uint32_t i = 0; i < 20; ++i) {
    send(noise(kYuyvBytes, i));
    held.push_back(frame());
    ASSERT_NE(held.back(), nullptr);
  }
  EXPECT_EQ(counters_->copied.value(), 18u);
  for (uint32_t i = 0; i < 20; ++i) {
    const auto sent = noise(kYuyvBytes, i);
    EXPECT_EQ(std::memcmp(held[i]->payload().bytes.data(), sent.data(), sent.size()), 0);
  }
}

TEST_F(LibcameraSourceTest, FramesOutliveTheSourceAndTheCameraIsStoppedAtOnce) {
  open();
  const auto sent = noise(kYuyvBytes);
  send(sent);
  const FramePtr kept = frame();
  source_.reset();
  EXPECT_TRUE(device_->stopped);
  EXPECT_EQ(std::memcmp(kept->payload().bytes.data(), sent.data(), sent.size()), 0);
}

TEST_F(LibcameraSourceTest, NothingIsAllocatedForAFrameOnceWarm) {
  open();
  for (int i = 0; i < 1000; ++i) send(std::vector<uint8_t>(kYuyvBytes));
  const auto take = [this] {
    const auto step = source_->next({}, 100ms);
    return step && step->frame && step->frame->i420().y.data != nullptr;
  };
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(take());
  const size_t before = test::allocations();
  int taken = 0;
  for (int i = 0; i < 900; ++i) taken += take();
  EXPECT_EQ(test::allocations() - before, 0u);
  EXPECT_EQ(taken, 900);
}

// Times.

TEST_F(LibcameraSourceTest, TheExposureTimeGivesItsMiddle) {
  open();
  const Time now = device_->now();
  const Time stamp = now + kPeriod - 12ms;
  device_->script.push_back({noise(kYuyvBytes), true, 1, to_ns(stamp), 8'000'000});
  const FramePtr got = frame();
  EXPECT_EQ(got->info().capture, stamp + 4ms);
  EXPECT_LE(got->info().capture_error, 500us);
  EXPECT_EQ(got->info().device_clock, ClockLabel::kMonotonic);
}

TEST_F(LibcameraSourceTest, StampsOfEitherClockAreUnderstoodAfterASleep) {
  for (const bool boot_time : {false, true}) {
    open();
    device_->asleep = 3h;
    const Time stamp = device_->now() + kPeriod - 12ms;
    const Duration offset = boot_time ? device_->asleep : Duration(0);
    device_->script.push_back({noise(kYuyvBytes), true, 1, to_ns(stamp + offset), 8'000'000});
    EXPECT_EQ(frame()->info().capture, stamp + 4ms);
  }
}

TEST_F(LibcameraSourceTest, WithoutAStampTheArrivalCounts) {
  open();
  device_->script.push_back({noise(kYuyvBytes), true, 1, 0});
  const FramePtr got = frame();
  EXPECT_EQ(got->info().capture, got->info().arrival);
  EXPECT_EQ(got->info().capture_error, 2 * kPeriod);
  EXPECT_EQ(got->info().device_clock, ClockLabel::kNone);
}

// Failures.

TEST_F(LibcameraSourceTest, GapsAndDamagedBuffersAreCounted) {
  open();
  send(noise(kYuyvBytes));
  device_->script.push_back({noise(kYuyvBytes), false});
  send(noise(kYuyvBytes - 1));
  device_->script.push_back({noise(kYuyvBytes), true, 3});
  EXPECT_EQ(frame()->info().dropped_before, 0u);
  EXPECT_EQ(frame()->info().dropped_before, 4u);
  EXPECT_EQ(counters_->damaged.value(), 2u);
  EXPECT_EQ(counters_->lost.value(), 4u);
  EXPECT_EQ(device_->queued.size(), 4u);
}

TEST_F(LibcameraSourceTest, DamagedJpegsAreDropped) {
  open("MJPEG");
  auto jpeg = test::make_jpeg(kWidth, kHeight, TJSAMP_420);
  ASSERT_LE(jpeg.size(), kYuyvBytes);
  auto cut = jpeg;
  cut.resize(cut.size() / 2);
  send(std::move(cut));
  send(jpeg);
  const FramePtr got = frame();
  ASSERT_NE(got, nullptr);
  EXPECT_EQ(got->info().format, PixelFormat::kMjpeg);
  EXPECT_EQ(got->payload().bytes.size(), jpeg.size());
  EXPECT_EQ(counters_->damaged.value(), 1u);
}

TEST_F(LibcameraSourceTest, BayerComesDemosaicedAndItsBufferGoesBack) {
  open("SRGGB8");
  send(std::vector<uint8_t>(size_t{kWidth} * kHeight, 128));
  const FramePtr got = frame();
  ASSERT_NE(got, nullptr);
  EXPECT_EQ(got->info().format, PixelFormat::kI420);
  EXPECT_NEAR(got->i420().u.row(3)[3], 128, 1);
  EXPECT_EQ(device_->queued.size(), 4u);
}

TEST_F(LibcameraSourceTest, AnUnpluggedCameraIsAnError) {
  open();
  device_->gone = true;
  EXPECT_THAT(source_->next({}, 100ms), FailsWith("gone"));
}

TEST_F(LibcameraSourceTest, SilenceEndsAtTheDeadline) {
  open();
  send(noise(kYuyvBytes));
  ASSERT_NE(frame(), nullptr);
  const Time before = device_->now();
  const Error error = failure();
  EXPECT_EQ(error.code, ErrorCode::kTimeout);
  EXPECT_THAT(error.text, testing::HasSubstr("stalled"));
  EXPECT_LE(device_->now() - before, 1100ms);
}

TEST_F(LibcameraSourceTest, OnlyFailingBuffersAreNoLife) {
  open();
  for (int i = 0; i < 200; ++i) device_->script.push_back({noise(kYuyvBytes), false});
  EXPECT_THAT(failure().text, testing::HasSubstr("suspect cable"));
}

TEST_F(LibcameraSourceTest, ACameraThatTakesNoRequestsIsAnError) {
  open();
  send(noise(kYuyvBytes));
  FramePtr got = frame();
  device_->refuses = true;
  got.reset();
  EXPECT_THAT(source_->next({}, 100ms), FailsWith("cannot go on"));
}

TEST_F(LibcameraSourceTest, AStopRequestIsSeenSoon) {
  open();
  std::stop_source stop;
  stop.request_stop();
  const auto step = source_->next(stop.get_token(), 10s);
  ASSERT_THAT(step, IsOk());
  EXPECT_EQ(step->kind, SourceStep::Kind::kTimeout);
}

// The library itself; on most test machines it finds no camera.

TEST(Libcamera, NamesTheCameraThatIsNotThere) {
  LibcameraOptions options;
  options.id = "nothing";
  const auto source = open_libcamera_source(options, CameraId(0), "left");
  ASSERT_FALSE(source.has_value());
  EXPECT_EQ(source.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(source.error().where, "left");
}

}  // namespace
}  // namespace sightline::capture
