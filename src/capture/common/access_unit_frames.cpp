// SPDX-License-Identifier: Apache-2.0
#include "capture/common/access_unit_frames.hpp"

#include <utility>

namespace sightline::capture {
namespace {

constexpr uint64_t kMaxPending = 32;  // units whose image may still come

}  // namespace

AccessUnitFrames::AccessUnitFrames(std::unique_ptr<AccessUnitDecoder> decoder,
                                   std::shared_ptr<ImagePool> pool,
                                   std::shared_ptr<CaptureCounters> counters)
    : decoder_(std::move(decoder)),
      pool_(std::move(pool)),
      counters_(std::move(counters)),
      frames_(kMaxPending) {}

bool AccessUnitFrames::accepts(std::span<const uint8_t> unit) {
  begun_ = begun_ || decoder_->can_begin(unit);
  return begun_;
}

Status AccessUnitFrames::push(std::span<const uint8_t> unit, const FrameInfo& frame) {
  ++pushed_;
  frames_[pushed_ % kMaxPending] = frame;
  return decoder_->push(unit, pushed_);
}

Result<FramePtr> AccessUnitFrames::pull(Duration limit) {
  auto image = pool_->get();
  SL_ASSIGN(const auto number, decoder_->pull(limit, image->mutable_view()));
  if (!number || *number <= decoded_ || *number > pushed_ || pushed_ - *number >= kMaxPending) {
    return FramePtr();
  }
  FrameInfo frame = frames_[*number % kMaxPending];
  for (uint64_t passed = decoded_ + 1; passed < *number; ++passed) {
    frame.dropped_before += 1;
    if (*number - passed < kMaxPending) {
      frame.dropped_before += frames_[passed % kMaxPending].dropped_before;
    }
    counters_->damaged.add();
  }
  decoded_ = *number;
  counters_->good.add();
  frame.format = PixelFormat::kI420;
  return Frame::decoded(frame, std::move(image), {}, pool_);
}

}  // namespace sightline::capture
