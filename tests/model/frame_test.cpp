// SPDX-License-Identifier: Apache-2.0
#include "sightline/model/frame.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <numeric>
#include <thread>
#include <vector>

#include "sightline/image/convert.hpp"

namespace sightline {
namespace {

FrameInfo info_of(PixelFormat format, int width, int height) {
  FrameInfo info;
  info.camera = CameraId(2);
  info.format = format;
  info.width = width;
  info.height = height;
  return info;
}

// A payload on the heap that tells when it is given back.
FramePayload payload_of(size_t bytes, std::shared_ptr<bool> gone) {
  auto owner = std::shared_ptr<std::vector<uint8_t>>(new std::vector<uint8_t>(bytes),
                                                     [gone](std::vector<uint8_t>* p) {
                                                       *gone = true;
                                                       delete p;
                                                     });
  std::iota(owner->begin(), owner->end(), uint8_t{0});
  FramePayload payload;
  payload.bytes = *owner;
  payload.owner = owner;
  return payload;
}

TEST(Frame, GivesThePayloadBackWithTheLastReference) {
  auto gone = std::make_shared<bool>(false);
  auto pool = std::make_shared<ImagePool>(8, 6);
  FramePtr frame = Frame::raw(info_of(PixelFormat::kYuyv, 8, 6), payload_of(96, gone), pool);
  FramePtr second = frame;
  frame.reset();
  EXPECT_FALSE(*gone);
  EXPECT_EQ(second->info().camera, CameraId(2));
  second.reset();
  EXPECT_TRUE(*gone);
}

TEST(Frame, ConvertsOnceOnDemand) {
  auto gone = std::make_shared<bool>(false);
  auto pool = std::make_shared<ImagePool>(8, 6);
  const FramePtr frame = Frame::raw(info_of(PixelFormat::kYuyv, 8, 6), payload_of(96, gone), pool);
  EXPECT_EQ(pool->allocated(), 0u);
  const I420View view = frame->i420();
  EXPECT_EQ(view.y.row(0)[1], 2);
  EXPECT_EQ(frame->i420().y.data, view.y.data);
  EXPECT_EQ(frame->gray().data, view.y.data);
  const PlaneView half = frame->half_gray();
  EXPECT_EQ(half.width, 4);
  EXPECT_EQ(half.height, 3);
  EXPECT_EQ(frame->half_gray().data, half.data);
  EXPECT_EQ(pool->allocated(), 2u);
  EXPECT_EQ(half.row(0)[0], (0 + 2 + 16 + 18 + 2) / 4);
}

TEST(Frame, CopiesStraightFromTheCamerasBytes) {
  const auto luma_sum = [](const Image& image) {
    unsigned sum = 0;
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x) sum = sum * 31 + image.view().y.row(y)[x];
    }
    return sum;
  };
  for (const PixelFormat format : {PixelFormat::kYuyv, PixelFormat::kI420, PixelFormat::kGray}) {
    auto gone = std::make_shared<bool>(false);
    auto pool = std::make_shared<ImagePool>(8, 6);
    const FramePtr frame = Frame::raw(info_of(format, 8, 6),
                                      payload_of(*raw_image_bytes(format, 8, 6, 0), gone), pool);
    Image straight(8, 6), shared(8, 6);
    frame->copy_i420_to(straight.mutable_view());
    EXPECT_EQ(pool->allocated(), 0u);
    copy_i420(frame->i420(), shared.mutable_view());
    EXPECT_EQ(luma_sum(straight), luma_sum(shared));
    Image again(8, 6);
    frame->copy_i420_to(again.mutable_view());
    EXPECT_EQ(luma_sum(again), luma_sum(shared));
  }
}

TEST(Frame, GrayOfPlanarPayloadsIsThePayload) {
  for (const PixelFormat format : {PixelFormat::kGray, PixelFormat::kI420, PixelFormat::kNv12}) {
    auto gone = std::make_shared<bool>(false);
    auto pool = std::make_shared<ImagePool>(9, 7);
    const FramePtr frame = Frame::raw(info_of(format, 9, 7),
                                      payload_of(*raw_image_bytes(format, 9, 7, 0), gone), pool);
    EXPECT_EQ(frame->gray().data, frame->payload().bytes.data());
    EXPECT_EQ(frame->gray().stride, 9);
    frame->i420();
    EXPECT_EQ(frame->gray().data, frame->payload().bytes.data());
    EXPECT_EQ(frame->half_gray().width, 4);
  }
}

TEST(Frame, I420PayloadsAreNotCopied) {
  auto gone = std::make_shared<bool>(false);
  auto pool = std::make_shared<ImagePool>(9, 7);
  const FramePtr frame =
      Frame::raw(info_of(PixelFormat::kI420, 9, 7), payload_of(9 * 7 + 2 * 5 * 4, gone), pool);
  const I420View view = frame->i420();
  EXPECT_EQ(view.y.data, frame->payload().bytes.data());
  EXPECT_EQ(view.u.data, view.y.data + 63);
  EXPECT_EQ(view.v.data, view.y.data + 63 + 20);
  EXPECT_EQ(view.v.row(3) + 5, frame->payload().bytes.data() + frame->payload().bytes.size());
  EXPECT_EQ(pool->allocated(), 0u);
}

TEST(Frame, DecodedFramesShareTheirImage) {
  auto image = std::make_shared<Image>(6, 4);
  image->mutable_view().y.row(0)[0] = 56;
  const FramePtr frame = Frame::decoded(info_of(PixelFormat::kH264, 6, 4), image);
  EXPECT_EQ(frame->i420().y.data, image->view().y.data);
  EXPECT_EQ(frame->gray().data, image->view().y.data);
  EXPECT_EQ(frame->half_gray().row(0)[0], (56 + 3 * 16 + 2) / 4);
  auto pool = std::make_shared<ImagePool>(6, 4);
  const FramePtr pooled = Frame::decoded(info_of(PixelFormat::kH264, 6, 4), image, {}, pool);
  EXPECT_EQ(pooled->half_gray().row(0)[0], (56 + 3 * 16 + 2) / 4);
  EXPECT_EQ(pool->allocated(), 1u);
}

// Who finds out where a camera looked has looked at its image: it is not converted again.
TEST(Frame, AFrameWithAnotherPlaceSharesWhatIsMade) {
  auto gone = std::make_shared<bool>(false);
  auto pool = std::make_shared<ImagePool>(8, 6);
  const auto place = std::make_shared<const CameraPlace>();
  const FramePtr frame = Frame::raw(info_of(PixelFormat::kYuyv, 8, 6), payload_of(96, gone), pool);
  const uint8_t* const luma = frame->gray().data;
  const FramePtr placed = Frame::with_place(frame, place);
  EXPECT_EQ(placed->info().place, place);
  EXPECT_EQ(placed->gray().data, luma);
  EXPECT_EQ(placed->payload().bytes.data(), frame->payload().bytes.data());
  EXPECT_EQ(pool->allocated(), 1u);
  // A gray payload stays the picture, in its full range.
  const FramePtr gray = Frame::raw(info_of(PixelFormat::kGray, 8, 6), payload_of(48, gone), pool);
  (void)gray->i420();
  EXPECT_EQ(Frame::with_place(gray, place)->gray().data, gray->payload().bytes.data());
}

TEST(Frame, ManyThreadsSeeTheSameViews) {
  for (int round = 0; round < 20; ++round) {
    auto gone = std::make_shared<bool>(false);
    auto pool = std::make_shared<ImagePool>(64, 48);
    const FramePtr frame =
        Frame::raw(info_of(PixelFormat::kNv12, 64, 48), payload_of(64 * 72, gone), pool);
    std::vector<std::thread> threads;
    std::atomic<int> wrong{0};
    for (int i = 0; i < 4; ++i) {
      threads.emplace_back([&] {
        const PlaneView half = frame->half_gray();
        const I420View view = frame->i420();
        if (frame->half_gray().data != half.data || frame->i420().u.data != view.u.data) ++wrong;
      });
    }
    for (auto& thread : threads) thread.join();
    EXPECT_EQ(wrong, 0);
    EXPECT_EQ(pool->allocated(), 2u);
  }
}

TEST(Frame, TooSmallToHalve) {
  const FramePtr frame =
      Frame::decoded(info_of(PixelFormat::kI420, 1, 9), std::make_shared<Image>(1, 9));
  EXPECT_EQ(frame->half_gray().data, nullptr);
}

TEST(FrameDeathTest, ShortPayloadsAreTheSourcesBug) {
  auto gone = std::make_shared<bool>(false);
  auto pool = std::make_shared<ImagePool>(8, 6);
  EXPECT_DEATH(Frame::raw(info_of(PixelFormat::kYuyv, 8, 6), payload_of(95, gone), pool), "small");
  EXPECT_DEATH(Frame::raw(info_of(PixelFormat::kMjpeg, 8, 6), payload_of(95, gone), pool), "raw");
}

}  // namespace
}  // namespace sightline
