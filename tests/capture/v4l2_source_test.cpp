// SPDX-License-Identifier: Apache-2.0
#include <cerrno>
#include <chrono>

#include "v4l2_source_fixture.hpp"

namespace sightline::capture {
namespace {

using namespace std::chrono_literals;
using test::FailsWith;
using test::IsOk;
using test::ScriptedV4l2;

// Numbers and times.

TEST_F(V4l2SourceTest, GapsInTheNumbersAreReported) {
  open();
  device_->send(noise(frame_bytes()));
  ASSERT_NE(frame(), nullptr);
  ScriptedV4l2::Buffer late{noise(frame_bytes())};
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
  ScriptedV4l2::Buffer faulty{noise(frame_bytes())};
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
  ScriptedV4l2::Buffer scripted{noise(frame_bytes())};
  scripted.stamp_ns = stamp;
  device_->send(scripted);
  const FrameInfo info = frame()->info();
  EXPECT_EQ(info.device_clock, ClockLabel::kMonotonic);
  EXPECT_EQ(info.device_time_ns, stamp);
  EXPECT_EQ(info.capture, time_from_ns(stamp) + 5ms);
  EXPECT_EQ(info.capture_error, 500us);
  EXPECT_EQ(info.arrival, device_->now());
}

TEST_F(V4l2SourceTest, StampsOfUnknownClocksAreNotTrusted) {
  open();
  ScriptedV4l2::Buffer scripted{noise(frame_bytes())};
  scripted.flags = V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN;
  device_->send(scripted);
  const FrameInfo info = frame()->info();
  EXPECT_EQ(info.device_clock, ClockLabel::kNone);
  EXPECT_EQ(info.capture, info.arrival);
  EXPECT_EQ(info.capture_error, 80ms);
  EXPECT_EQ(counters_->stamp_rejected.value(), 0u);
}

TEST_F(V4l2SourceTest, ImpossibleStampsAreReplacedAndCounted) {
  open();
  ScriptedV4l2::Buffer scripted{noise(frame_bytes())};
  scripted.stamp_ns = to_ns(device_->now()) + int64_t{4'000'000'000'000};
  device_->send(scripted);
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
  ScriptedV4l2::Buffer faulty{noise(frame_bytes())};
  faulty.flags |= V4L2_BUF_FLAG_ERROR;
  for (int i = 0; i < 200; ++i) device_->send(faulty);
  EXPECT_THAT(next(), FailsWith("suspect cable, hub or power"));
}

TEST_F(V4l2SourceTest, BuffersThatDoNotExistAreAnError) {
  open();
  ScriptedV4l2::Buffer wild{noise(frame_bytes())};
  wild.change = [](v4l2_buffer& buffer) { buffer.index = 99; };
  device_->send(wild);
  EXPECT_THAT(next(), FailsWith("gave buffer 99, which it does not have"));
}

TEST_F(V4l2SourceTest, SizesThatLieNeverReadBeyondTheBuffer) {
  open();
  ScriptedV4l2::Buffer wild{noise(frame_bytes())};
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

}  // namespace
}  // namespace sightline::capture
