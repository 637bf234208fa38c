// SPDX-License-Identifier: Apache-2.0
#include <thread>

#include "v4l2_source_fixture.hpp"

namespace sightline::capture {
namespace {

using test::FailsWith;

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

}  // namespace
}  // namespace sightline::capture
