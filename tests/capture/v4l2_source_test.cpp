// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <numeric>
#include <thread>

#include "device_tree.hpp"
#include "jpeg_maker.hpp"
#include "scripted_v4l2.hpp"
#include "sightline/image/convert.hpp"
#include "support/allocations.hpp"
#include "support/matchers.hpp"
#include "v4l2_formats.hpp"
#include "v4l2_open.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using test::FailsWith;
using test::IsOk;
using test::ScriptedV4l2;

constexpr uint32_t kWidth = 32, kHeight = 16;

std::vector<uint8_t> noise(size_t size, uint32_t seed = 1) {
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
    return open_v4l2_source_in(options_, CameraId(3), "left", tree_.places(), device_);
  }
  void open() {
    source_.reset();
    auto source = try_open();
    ASSERT_THAT(source, IsOk());
    source_ = *std::move(source);
  }
  size_t frame_bytes() const { return kWidth * kHeight * 2; }
  Result<SourceStep> next(Duration timeout = 10s) { return source_->next({}, timeout); }
  FramePtr frame() {
    auto step = next();
    EXPECT_THAT(step, IsOk());
    return step && step->kind == SourceStep::Kind::kFrame ? step->frame : nullptr;
  }

  test::DeviceTree tree_;
  std::shared_ptr<ScriptedV4l2> device_ = std::make_shared<ScriptedV4l2>();
  std::shared_ptr<CaptureCounters> counters_ = std::make_shared<CaptureCounters>();
  V4l2Options options_;
  std::unique_ptr<FrameSource> source_;
};

void expect_same(const I420View& a, const I420View& b) {
  const auto same = [](const PlaneView& p, const PlaneView& q) {
    for (int y = 0; y < p.height; ++y) {
      if (std::memcmp(p.row(y), q.row(y), static_cast<size_t>(p.width)) != 0) return false;
    }
    return true;
  };
  EXPECT_TRUE(same(a.y, b.y) && same(a.u, b.u) && same(a.v, b.v));
}

// Formats.

class RawFormats : public V4l2SourceTest, public testing::WithParamInterface<uint32_t> {};

TEST_P(RawFormats, ArriveByteForByteInTheDriversOwnBuffer) {
  use(GetParam());
  const PixelFormat format = find_v4l2_format(GetParam())->pixels;
  open();
  const auto sent = noise(*raw_picture_bytes(format, kWidth, kHeight, 0));
  device_->send(sent);
  const FramePtr got = frame();
  ASSERT_NE(got, nullptr);
  const auto bytes = got->payload().bytes;
  EXPECT_TRUE(device_->owns(bytes.data()));
  EXPECT_TRUE(std::equal(bytes.begin(), bytes.end(), sent.begin(), sent.end()));
  EXPECT_GE(got->payload().dmabuf_fd, 0);
  EXPECT_EQ(got->info().format, format);
  EXPECT_EQ(got->info().camera, CameraId(3));
  Picture expected(kWidth, kHeight);
  ASSERT_THAT(raw_to_i420(format, sent, 0, expected.mutable_view()), IsOk());
  expect_same(got->i420(), expected.view());
}

// From the driver's buffer to the first conversion no byte is copied and nothing is allocated.
TEST_P(RawFormats, CostNeitherCopyNorAllocationOnceWarm) {
  use(GetParam());
  const PixelFormat format = find_v4l2_format(GetParam())->pixels;
  open();
  const auto sent = noise(*raw_picture_bytes(format, kWidth, kHeight, 0));
  constexpr int kWarm = 20, kFrames = 300;
  for (int i = 0; i < kWarm + kFrames; ++i) device_->send(sent);
  Picture to(kWidth, kHeight);
  int in_place = 0;
  const auto take = [&] {
    const auto step = next(100ms);
    const FramePtr& got = step->frame;
    got->copy_i420_to(to.mutable_view());  // what the drawing side does
    got->i420();                           // what the observing side does
    got->half_grey();
    in_place += device_->owns(got->payload().bytes.data());
  };
  for (int i = 0; i < kWarm; ++i) take();
  const size_t before = test::allocations();
  for (int i = 0; i < kFrames; ++i) take();
  EXPECT_EQ(test::allocations() - before, 0u);
  EXPECT_EQ(in_place, kWarm + kFrames);
  EXPECT_EQ(counters_->copied.value(), 0u);
  EXPECT_EQ(counters_->good.value(), uint64_t{kWarm + kFrames});
}

INSTANTIATE_TEST_SUITE_P(V4l2, RawFormats,
                         testing::Values(V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_UYVY, V4L2_PIX_FMT_NV12,
                                         V4L2_PIX_FMT_YUV420, V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_Y10,
                                         V4L2_PIX_FMT_Y12, V4L2_PIX_FMT_Y16, V4L2_PIX_FMT_RGB24,
                                         V4L2_PIX_FMT_BGR24));

class BayerFormats : public V4l2SourceTest, public testing::WithParamInterface<uint32_t> {};

TEST_P(BayerFormats, ComeDecodedAndGiveTheBufferBackAtOnce) {
  use(GetParam());
  open();
  const V4l2Format format = *find_v4l2_format(GetParam());
  const size_t row = bayer_row_bytes(format.packing, kWidth);
  const auto sent = noise(row * kHeight);
  device_->send(sent);
  const FramePtr got = frame();
  ASSERT_NE(got, nullptr);
  EXPECT_EQ(device_->queued(), 4u);
  EXPECT_EQ(got->info().format, PixelFormat::kI420);
  Picture expected(kWidth, kHeight);
  BayerDecoder decoder(format.pattern, format.packing, kWidth, kHeight);
  ASSERT_THAT(decoder.decode(sent, static_cast<ptrdiff_t>(row), expected.mutable_view()), IsOk());
  expect_same(got->i420(), expected.view());
}

INSTANTIATE_TEST_SUITE_P(V4l2, BayerFormats,
                         testing::Values(V4L2_PIX_FMT_SRGGB8, V4L2_PIX_FMT_SBGGR10,
                                         V4L2_PIX_FMT_SGRBG12, V4L2_PIX_FMT_SRGGB10P,
                                         V4L2_PIX_FMT_SBGGR12P));

class DecodedFormats : public V4l2SourceTest, public testing::WithParamInterface<uint32_t> {};

TEST_P(DecodedFormats, AllocateNothingOnceWarm) {
  use(GetParam());
  open();
  const V4l2Format format = *find_v4l2_format(GetParam());
  const auto sent = format.kind == V4l2Kind::kMjpeg
                        ? test::make_jpeg(kWidth, kHeight, TJSAMP_422)
                        : noise(bayer_row_bytes(format.packing, kWidth) * kHeight);
  constexpr int kWarm = 20, kFrames = 200;
  for (int i = 0; i < kWarm + kFrames; ++i) device_->send(sent);
  int got = 0;
  const auto take = [&] {
    const auto step = next(100ms);
    got += step->frame->i420().y.data != nullptr;
  };
  for (int i = 0; i < kWarm; ++i) take();
  const size_t before = test::allocations();
  for (int i = 0; i < kFrames; ++i) take();
  EXPECT_EQ(test::allocations() - before, 0u);
  EXPECT_EQ(got, kWarm + kFrames);
}

INSTANTIATE_TEST_SUITE_P(V4l2, DecodedFormats,
                         testing::Values(V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_SRGGB8,
                                         V4L2_PIX_FMT_SRGGB12, V4L2_PIX_FMT_SRGGB10P));

TEST_F(V4l2SourceTest, PaddedRowsAreUnderstood) {
  device_->bytes_per_line = 2 * kWidth + 16;
  open();
  const auto sent = noise(device_->bytes_per_line * kHeight);
  device_->send(sent);
  const FramePtr got = frame();
  ASSERT_NE(got, nullptr);
  EXPECT_EQ(got->payload().stride, 2 * kWidth + 16);
  Picture expected(kWidth, kHeight);
  ASSERT_THAT(raw_to_i420(PixelFormat::kYuyv, sent, 2 * kWidth + 16, expected.mutable_view()),
              IsOk());
  expect_same(got->i420(), expected.view());
}

TEST_F(V4l2SourceTest, MjpegComesDecodedWithItsBytes) {
  use(V4L2_PIX_FMT_MJPEG);
  open();
  const auto jpeg = test::make_jpeg(kWidth, kHeight, TJSAMP_422);
  auto padded = jpeg;
  padded.resize(jpeg.size() + 64, 0);
  device_->send(padded);
  const FramePtr got = frame();
  ASSERT_NE(got, nullptr);
  EXPECT_EQ(got->info().format, PixelFormat::kMjpeg);
  const auto bytes = got->payload().bytes;
  EXPECT_TRUE(std::equal(bytes.begin(), bytes.end(), jpeg.begin(), jpeg.end()));
  EXPECT_TRUE(device_->owns(bytes.data()));
  EXPECT_GT(got->grey().row(8)[20], got->grey().row(8)[2]);
}

TEST_F(V4l2SourceTest, DamagedMjpegIsDroppedCountedAndNeverFatal) {
  use(V4L2_PIX_FMT_MJPEG);
  open();
  const auto jpeg = test::make_jpeg(kWidth, kHeight, TJSAMP_422);
  device_->send(jpeg);
  ASSERT_NE(frame(), nullptr);
  device_->send({jpeg.begin(), jpeg.begin() + static_cast<ptrdiff_t>(jpeg.size() / 2)});
  device_->send(noise(300));
  device_->send(std::vector<uint8_t>{});
  device_->send(test::make_jpeg(kWidth * 2, kHeight / 2, TJSAMP_422));
  device_->send(jpeg);
  const FramePtr got = frame();
  ASSERT_NE(got, nullptr);
  EXPECT_EQ(got->info().dropped_before, 4u);
  EXPECT_EQ(counters_->damaged.value(), 4u);
  EXPECT_EQ(counters_->good.value(), 2u);
  EXPECT_EQ(device_->queued(), 3u);
  // Garbage for longer than the deadline: the camera is alive all the same.
  for (int i = 0; i < 100; ++i) device_->send(noise(300));
  for (int i = 0; i < 100; ++i) EXPECT_THAT(next(40ms), IsOk());
}

TEST_F(V4l2SourceTest, AutoPrefersUncompressedThatReachesTheRate) {
  device_->modes = {{V4L2_PIX_FMT_H264, kWidth, kHeight, {60}},
                    {V4L2_PIX_FMT_MJPEG, kWidth, kHeight, {30, 60}},
                    {V4L2_PIX_FMT_YUYV, kWidth, kHeight, {5, 30}}};
  options_.width = kWidth;
  options_.height = kHeight;
  options_.rate_hz = 30;
  open();
  EXPECT_EQ(device_->format().pixelformat, uint32_t{V4L2_PIX_FMT_YUYV});
  options_.rate_hz = 60;
  open();
  EXPECT_EQ(device_->format().pixelformat, uint32_t{V4L2_PIX_FMT_MJPEG});
  EXPECT_EQ(source_->info().nominal_rate_hz, 60);
  options_.rate_hz = 90;
  EXPECT_THAT(try_open(), FailsWith("has no usable format for 32x16 at 90/s; it has: H264 32x16 up "
                                    "to 60/s, MJPEG 32x16"));
}

TEST_F(V4l2SourceTest, WhatTheCameraHasNotIsRefusedWithWhatItHas) {
  options_.format = "PNG";
  EXPECT_THAT(try_open(), FailsWith("unknown pixel format 'PNG'"));
  options_.format = "YUYV";
  device_->adjusts_size = true;
  EXPECT_THAT(try_open(),
              FailsWith("gives YUYV 16x16 when asked for YUYV 32x16; it has: YUYV 32x16"));
  EXPECT_EQ(device_->open_files(), 0);
}

TEST_F(V4l2SourceTest, NodesThatDoNotCaptureAreRefused) {
  device_->capabilities = V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING;
  EXPECT_THAT(try_open(), FailsWith("does not capture pictures"));
  device_->capabilities = V4L2_CAP_VIDEO_CAPTURE_MPLANE | V4L2_CAP_STREAMING;
  EXPECT_THAT(try_open(), FailsWith("multi-planar"));
  device_->capabilities = V4L2_CAP_VIDEO_CAPTURE;
  EXPECT_THAT(try_open(), FailsWith("no memory-mapped streaming"));
}

// Buffers.

TEST_F(V4l2SourceTest, BuffersGoBackWhenTheLastFrameLetsGo) {
  open();
  EXPECT_EQ(device_->buffers(), 4u);
  for (int i = 0; i < 20; ++i) {
    device_->send(noise(frame_bytes()));
    FramePtr first = frame();
    const FramePtr second = first;
    EXPECT_EQ(device_->queued(), 3u);
    first.reset();
    EXPECT_EQ(device_->queued(), 3u);
  }
  EXPECT_EQ(device_->queued(), 4u);
  EXPECT_EQ(counters_->copied.value(), 0u);
}

TEST_F(V4l2SourceTest, AReaderThatHoldsTooManyGetsCopies) {
  open();
  std::vector<FramePtr> held;
  for (uint32_t i = 0; i < 10; ++i) {
    device_->send(noise(frame_bytes(), i));
    held.push_back(frame());
    EXPECT_GE(device_->queued(), 2u);
  }
  EXPECT_EQ(counters_->copied.value(), 8u);
  for (uint32_t i = 0; i < 10; ++i) {
    const auto sent = noise(frame_bytes(), i);
    const auto bytes = held[i]->payload().bytes;
    EXPECT_TRUE(std::equal(bytes.begin(), bytes.end(), sent.begin(), sent.end())) << i;
    EXPECT_EQ(held[i]->payload().dmabuf_fd >= 0, i < 2);
  }
}

TEST_F(V4l2SourceTest, FramesOutliveTheSourceAndTheDeviceIsClosedAtOnce) {
  device_->exports = false;
  open();
  const auto sent = noise(frame_bytes());
  device_->send(sent);
  FramePtr held = frame();
  EXPECT_EQ(held->payload().dmabuf_fd, -1);
  source_.reset();
  EXPECT_EQ(device_->open_files(), 0);
  EXPECT_FALSE(device_->streaming());
  EXPECT_EQ(device_->mapped(), 4u);
  EXPECT_TRUE(std::equal(sent.begin(), sent.end(), held->payload().bytes.begin()));
  held.reset();
  EXPECT_EQ(device_->mapped(), 0u);
}

TEST_F(V4l2SourceTest, FramesAreReleasedFromOtherThreads) {
  open();
  std::vector<std::thread> readers;
  for (int i = 0; i < 200; ++i) {
    device_->send(noise(frame_bytes(), static_cast<uint32_t>(i)));
    FramePtr got = frame();
    ASSERT_NE(got, nullptr);
    readers.emplace_back([kept = std::move(got)]() mutable {
      EXPECT_EQ(kept->i420().width(), static_cast<int>(kWidth));
      kept.reset();
    });
    if (readers.size() == 8) {
      for (auto& reader : readers) reader.join();
      readers.clear();
    }
  }
  for (auto& reader : readers) reader.join();
  EXPECT_EQ(device_->queued(), 4u);
}

TEST_F(V4l2SourceTest, ABufferThatIsRefusedOnceIsQueuedAgain) {
  open();
  device_->send(noise(frame_bytes()));
  FramePtr got = frame();
  device_->refuse_next_queueing(1);
  got.reset();
  EXPECT_EQ(device_->queued(), 3u);
  device_->send(noise(frame_bytes()));
  got = frame();
  ASSERT_NE(got, nullptr);
  got.reset();
  EXPECT_EQ(device_->queued(), 4u);
}

TEST_F(V4l2SourceTest, ABufferThatIsRefusedForGoodIsAnError) {
  open();
  device_->send(noise(frame_bytes()));
  FramePtr got = frame();
  device_->refuse_next_queueing(1000);
  got.reset();
  EXPECT_THAT(next(), FailsWith("opening the camera again usually helps"));
}

TEST_F(V4l2SourceTest, NothingLeaksOverManyReopenings) {
  for (int i = 0; i < 50; ++i) {
    open();
    device_->send(noise(frame_bytes()));
    ASSERT_NE(frame(), nullptr);
    source_.reset();
  }
  EXPECT_EQ(device_->open_files(), 0);
  EXPECT_EQ(device_->mapped(), 0u);
}

// Numbers and times.

TEST_F(V4l2SourceTest, GapsInTheNumbersAreReported) {
  open();
  device_->send(noise(frame_bytes()));
  ASSERT_NE(frame(), nullptr);
  ScriptedV4l2::Shot late{noise(frame_bytes())};
  late.advance = 4;
  device_->send(late);
  const FramePtr got = frame();
  EXPECT_EQ(got->info().sequence, 4u);
  EXPECT_EQ(got->info().dropped_before, 3u);
  EXPECT_EQ(counters_->lost.value(), 3u);
}

TEST_F(V4l2SourceTest, FaultyAndShortBuffersAreDropped) {
  open();
  device_->send(noise(frame_bytes()));
  ASSERT_NE(frame(), nullptr);
  ScriptedV4l2::Shot faulty{noise(frame_bytes())};
  faulty.flags |= V4L2_BUF_FLAG_ERROR;
  device_->send(faulty);
  device_->send(noise(frame_bytes() - 1));
  // What an endpoint stall looks like: flagged, number 0, time 0.
  faulty.change = [](v4l2_buffer& buffer) { buffer.sequence = 0, buffer.timestamp = {}; };
  device_->send(faulty);
  device_->send(noise(frame_bytes()));
  const FramePtr got = frame();
  EXPECT_EQ(got->info().dropped_before, 3u);
  EXPECT_EQ(counters_->damaged.value(), 3u);
  EXPECT_EQ(device_->queued(), 3u);
}

TEST_F(V4l2SourceTest, StampsBecomeTheMiddleOfTheExposure) {
  device_->controls = {{V4L2_CID_EXPOSURE_AUTO, "Auto Exposure", V4L2_CTRL_TYPE_MENU, 0, 3, 1},
                       {V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure Time, Absolute",
                        V4L2_CTRL_TYPE_INTEGER, 1, 5000, 100}};
  open();
  const int64_t stamp = to_ns(device_->now()) + 15'000'000;
  ScriptedV4l2::Shot shot{noise(frame_bytes())};
  shot.stamp_ns = stamp;
  device_->send(shot);
  const FrameInfo info = frame()->info();
  EXPECT_EQ(info.device_clock, ClockLabel::kMonotonic);
  EXPECT_EQ(info.device_time_ns, stamp);
  EXPECT_EQ(info.capture, time_from_ns(stamp) + 5ms);
  EXPECT_EQ(info.capture_error, 500us);
  EXPECT_EQ(info.arrival, device_->now());
}

TEST_F(V4l2SourceTest, StampsOfUnknownClocksAreNotTrusted) {
  open();
  ScriptedV4l2::Shot shot{noise(frame_bytes())};
  shot.flags = V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN;
  device_->send(shot);
  const FrameInfo info = frame()->info();
  EXPECT_EQ(info.device_clock, ClockLabel::kNone);
  EXPECT_EQ(info.capture, info.arrival);
  EXPECT_EQ(info.capture_error, 80ms);
  EXPECT_EQ(counters_->stamp_rejected.value(), 0u);
}

TEST_F(V4l2SourceTest, ImpossibleStampsAreReplacedAndCounted) {
  open();
  ScriptedV4l2::Shot shot{noise(frame_bytes())};
  shot.stamp_ns = to_ns(device_->now()) + int64_t{4'000'000'000'000};
  device_->send(shot);
  const FrameInfo info = frame()->info();
  EXPECT_EQ(info.capture, info.arrival);
  EXPECT_GT(info.capture_error, 0ns);
  EXPECT_EQ(counters_->stamp_rejected.value(), 1u);
}

// Trouble.

TEST_F(V4l2SourceTest, TroubleAtOpeningSaysWhatToDo) {
  const auto says = [&](int number, const char* text) {
    device_->open_errno = number;
    EXPECT_THAT(try_open(), FailsWith(text));
    EXPECT_THAT(try_open(), FailsWith("left: "));
  };
  says(ENOENT, "there is no such device");
  says(ENODEV, "the camera is gone");
  says(EBUSY, "another program is using the camera");
  says(EACCES, "add the user to the group `video`");
}

TEST_F(V4l2SourceTest, TroubleAtStartingSaysWhatToDo) {
  const auto says = [&](unsigned long request, int number, const char* text) {
    device_->failures = {{request, number}};
    EXPECT_THAT(try_open(), FailsWith(text));
    EXPECT_EQ(device_->open_files(), 0);
    EXPECT_EQ(device_->mapped(), 0u);
  };
  says(VIDIOC_STREAMON, ENOSPC, "the USB bus has no bandwidth left");
  says(VIDIOC_STREAMON, EIO, "the camera did not obey");
  says(VIDIOC_STREAMON, EINVAL, "cannot start streaming");
  says(VIDIOC_S_FMT, EBUSY, "another program is using the camera");
  says(VIDIOC_S_FMT, EINVAL, "the driver refuses the settings");
  says(VIDIOC_REQBUFS, ENOMEM, "no memory");
  says(VIDIOC_QBUF, EINVAL, "cannot get buffers");
  says(VIDIOC_QUERYCAP, ENOTTY, "this is no V4L2 camera");
}

TEST_F(V4l2SourceTest, UnpluggingAndTransferErrorsAreToldApart) {
  open();
  device_->break_down(ENODEV);
  const auto gone = next();
  EXPECT_THAT(gone, FailsWith("the camera is gone (unplugged"));
  EXPECT_EQ(gone.error().code, ErrorCode::kUnavailable);
  device_->break_down(0);
  open();
  device_->break_down(EIO);
  const auto broken = next();
  EXPECT_THAT(broken, FailsWith("the transfer broke down"));
  EXPECT_EQ(broken.error().code, ErrorCode::kIo);
}

TEST_F(V4l2SourceTest, ADriverThatStopsWithoutAReasonIsAnError) {
  open();
  device_->break_down(EAGAIN);
  EXPECT_THAT(next(), FailsWith("the transfer broke down"));
}

TEST_F(V4l2SourceTest, SilenceEndsAtTheDeadline) {
  open();
  const Time begin = device_->now();
  EXPECT_EQ(next(4s)->kind, SourceStep::Kind::kTimeout);
  EXPECT_THAT(next(), FailsWith("the camera has stalled"));  // the first frame: five seconds
  EXPECT_NEAR(to_seconds(device_->now() - begin), 5.0, 0.1);
  open();
  device_->send(noise(frame_bytes()));
  ASSERT_NE(frame(), nullptr);
  const Time last = device_->now();
  const auto stalled = next();
  EXPECT_EQ(stalled.error().code, ErrorCode::kTimeout);
  EXPECT_NEAR(to_seconds(device_->now() - last), 1.0, 0.1);
}

TEST_F(V4l2SourceTest, SlowCamerasHaveFivePeriods) {
  device_->modes = {{V4L2_PIX_FMT_YUYV, kWidth, kHeight, {2}}};
  options_.rate_hz = 2;
  open();
  device_->send(noise(frame_bytes()));
  ASSERT_NE(frame(), nullptr);
  EXPECT_EQ(next(2400ms)->kind, SourceStep::Kind::kTimeout);
  EXPECT_FALSE(next(200ms));
}

TEST_F(V4l2SourceTest, NothingButFaultyBuffersEndsAtTheDeadline) {
  open();
  ScriptedV4l2::Shot faulty{noise(frame_bytes())};
  faulty.flags |= V4L2_BUF_FLAG_ERROR;
  for (int i = 0; i < 200; ++i) device_->send(faulty);
  EXPECT_THAT(next(), FailsWith("suspect cable, hub or power"));
}

TEST_F(V4l2SourceTest, BuffersThatDoNotExistAreAnError) {
  open();
  ScriptedV4l2::Shot wild{noise(frame_bytes())};
  wild.change = [](v4l2_buffer& buffer) { buffer.index = 99; };
  device_->send(wild);
  EXPECT_THAT(next(), FailsWith("gave buffer 99, which it does not have"));
}

TEST_F(V4l2SourceTest, SizesThatLieNeverReadBeyondTheBuffer) {
  open();
  ScriptedV4l2::Shot wild{noise(frame_bytes())};
  wild.change = [](v4l2_buffer& buffer) { buffer.bytesused = UINT32_MAX; };
  device_->send(wild);
  const FramePtr got = frame();
  ASSERT_NE(got, nullptr);
  EXPECT_EQ(got->payload().bytes.size(), frame_bytes());
}

TEST_F(V4l2SourceTest, AStopRequestEndsTheWait) {
  open();
  std::stop_source stop;
  stop.request_stop();
  const auto step = source_->next(stop.get_token(), 1h);
  ASSERT_THAT(step, IsOk());
  EXPECT_EQ(step->kind, SourceStep::Kind::kTimeout);
}

TEST_F(V4l2SourceTest, OnlyTheCameraMeantIsOpened) {
  tree_.add(4, "Scripted camera", "1-4", "B0");
  options_.device = "usb:1-4,serial:B0";
  EXPECT_THAT(try_open(), IsOk());
  options_.device = "usb:1-4,serial:A0";
  EXPECT_THAT(try_open(), FailsWith("identity mismatch"));
  tree_.remove(4);
  EXPECT_THAT(try_open(), FailsWith("no camera 'usb:1-4,serial:A0' is plugged in"));
}

// Controls.

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
}  // namespace sightline
