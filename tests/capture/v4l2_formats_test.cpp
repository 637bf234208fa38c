// SPDX-License-Identifier: Apache-2.0
#include <cstring>

#include "capture/decode/fourcc_formats.hpp"
#include "jpeg_maker.hpp"
#include "sightline/image/convert.hpp"
#include "support/allocations.hpp"
#include "v4l2_source_fixture.hpp"

namespace sightline::capture {
namespace {

using namespace std::chrono_literals;
using test::FailsWith;
using test::IsOk;

void expect_same(const I420View& a, const I420View& b) {
  const auto same = [](const PlaneView& p, const PlaneView& q) {
    for (int y = 0; y < p.height; ++y) {
      if (std::memcmp(p.row(y), q.row(y), static_cast<size_t>(p.width)) != 0) return false;
    }
    return true;
  };
  EXPECT_TRUE(same(a.y, b.y) && same(a.u, b.u) && same(a.v, b.v));
}

class RawFormats : public V4l2SourceTest, public testing::WithParamInterface<uint32_t> {};

TEST_P(RawFormats, ArriveByteForByteInTheDriversOwnBuffer) {
  use(GetParam());
  const PixelFormat format = find_fourcc_format(GetParam())->pixels;
  open();
  const auto sent = noise(*raw_image_bytes(format, kWidth, kHeight, 0));
  device_->send(sent);
  const FramePtr got = frame();
  ASSERT_NE(got, nullptr);
  const auto bytes = got->payload().bytes;
  EXPECT_TRUE(device_->owns(bytes.data()));
  EXPECT_TRUE(std::equal(bytes.begin(), bytes.end(), sent.begin(), sent.end()));
  EXPECT_GE(got->payload().dmabuf_fd, 0);
  EXPECT_EQ(got->info().format, format);
  EXPECT_EQ(got->info().camera, CameraId(3));
  Image expected(kWidth, kHeight);
  ASSERT_THAT(raw_to_i420(format, sent, 0, expected.mutable_view()), IsOk());
  expect_same(got->i420(), expected.view());
}

// From the driver's buffer to the first conversion no byte is copied and nothing is allocated.
TEST_P(RawFormats, CostNeitherCopyNorAllocationOnceWarm) {
  use(GetParam());
  const PixelFormat format = find_fourcc_format(GetParam())->pixels;
  open();
  const auto sent = noise(*raw_image_bytes(format, kWidth, kHeight, 0));
  constexpr int kWarm = 20, kFrames = 300;
  for (int i = 0; i < kWarm + kFrames; ++i) device_->send(sent);
  Image to(kWidth, kHeight);
  int in_place = 0;
  const auto take = [&] {
    const auto step = next(100ms);
    const FramePtr& got = step->frame;
    got->copy_i420_to(to.mutable_view());  // what the drawing side does
    got->i420();                           // what the observing side does
    got->half_gray();
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
  const FourccFormat format = *find_fourcc_format(GetParam());
  const size_t row = bayer_row_bytes(format.packing, kWidth);
  const auto sent = noise(row * kHeight);
  device_->send(sent);
  const FramePtr got = frame();
  ASSERT_NE(got, nullptr);
  EXPECT_EQ(device_->queued(), 4u);
  EXPECT_EQ(got->info().format, PixelFormat::kI420);
  Image expected(kWidth, kHeight);
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
  const FourccFormat format = *find_fourcc_format(GetParam());
  const auto sent = format.kind == FormatKind::kMjpeg
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
  Image expected(kWidth, kHeight);
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
  EXPECT_GT(got->gray().row(8)[20], got->gray().row(8)[2]);
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
  EXPECT_THAT(try_open(), FailsWith("does not capture images"));
  device_->capabilities = V4L2_CAP_VIDEO_CAPTURE_MPLANE | V4L2_CAP_STREAMING;
  EXPECT_THAT(try_open(), FailsWith("multi-planar"));
  device_->capabilities = V4L2_CAP_VIDEO_CAPTURE;
  EXPECT_THAT(try_open(), FailsWith("no memory-mapped streaming"));
}

}  // namespace
}  // namespace sightline::capture
