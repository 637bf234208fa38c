// SPDX-License-Identifier: Apache-2.0
#include "capture/common/frame_ids.hpp"

#include <gtest/gtest.h>

namespace sightline::capture {
namespace {

TEST(FrameIds, SixteenBitsWrapFromLastToOne) {
  FrameIds ids(FrameIds::Width::k16);
  uint64_t expected = 0;
  uint64_t id = 65400;
  for (int i = 0; i < 140'000; ++i) {
    const FrameIds::Step step = ids.step(id);
    ASSERT_EQ(step.sequence, expected++);
    ASSERT_EQ(step.dropped_before, 0u);
    id = id == 65535 ? 1 : id + 1;
  }
}

TEST(FrameIds, CountsWhatIsMissingAcrossTheWrap) {
  FrameIds ids(FrameIds::Width::k16);
  ids.step(65533);
  const FrameIds::Step step = ids.step(2);  // 65534, 65535, 1 are missing
  EXPECT_EQ(step.dropped_before, 3u);
  EXPECT_EQ(step.sequence, 4u);
}

TEST(FrameIds, SixtyFourBitsNeverWrap) {
  FrameIds ids(FrameIds::Width::k16);
  ids.step(65534);
  EXPECT_EQ(ids.step(65535).dropped_before, 0u);
  EXPECT_EQ(ids.step(65536).dropped_before, 0u);
  EXPECT_EQ(ids.step(65540).dropped_before, 3u);
  FrameIds usb(FrameIds::Width::k64);
  EXPECT_EQ(usb.step(0).sequence, 0u);
  EXPECT_EQ(usb.step(1).sequence, 1u);
  EXPECT_EQ(usb.step(uint64_t{1} << 40).dropped_before, 0xFFFFFFFFu);  // saturates
}

TEST(FrameIds, RepeatedAndReturningNumbersGrowByOne) {
  FrameIds ids(FrameIds::Width::k16);
  ids.step(0);
  EXPECT_EQ(ids.step(0).sequence, 1u);  // a camera that does not count
  EXPECT_EQ(ids.step(0).sequence, 2u);
  FrameIds restarted(FrameIds::Width::k16);
  restarted.step(500);
  const FrameIds::Step step = restarted.step(1);
  EXPECT_EQ(step.sequence, 1u);
  EXPECT_EQ(step.dropped_before, 0u);
}

TEST(FrameIds, ThirtyTwoBitsWrapFromLastToZero) {
  FrameIds ids(FrameIds::Width::k32);
  EXPECT_EQ(ids.step(0xfffffffe).sequence, 0u);
  EXPECT_EQ(ids.step(0xffffffff).sequence, 1u);
  const FrameIds::Step wrapped = ids.step(3);
  EXPECT_EQ(wrapped.sequence, 5u);
  EXPECT_EQ(wrapped.dropped_before, 3u);
  EXPECT_EQ(ids.step(3).sequence, 6u);  // stands still
  const FrameIds::Step back = ids.step(0);
  EXPECT_EQ(back.sequence, 7u);
  EXPECT_EQ(back.dropped_before, 0u);
}

}  // namespace
}  // namespace sightline::capture
