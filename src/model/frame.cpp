// SPDX-License-Identifier: Apache-2.0
#include "sightline/model/frame.hpp"

#include <utility>

#include "sightline/base/check.hpp"
#include "sightline/base/recycling_allocator.hpp"
#include "sightline/image/convert.hpp"

namespace sightline {
namespace {

bool luma_comes_first(PixelFormat format) {
  return format == PixelFormat::kGray || format == PixelFormat::kI420 ||
         format == PixelFormat::kNv12;
}

// The payload's own planes; only for formats whose luma comes first.
PlaneView luma_of(const FrameInfo& info, const FramePayload& payload) {
  return {payload.bytes.data(), info.width, info.height,
          payload.stride != 0 ? payload.stride : info.width};
}

I420View planes_of(const FrameInfo& info, const FramePayload& payload) {
  const PlaneView y = luma_of(info, payload);
  const int width = (info.width + 1) / 2, height = (info.height + 1) / 2;
  const ptrdiff_t stride = (y.stride + 1) / 2;
  const uint8_t* const u = y.data + y.stride * info.height;
  return {y, {u, width, height, stride}, {u + stride * height, width, height, stride}};
}

}  // namespace

Frame::Frame(Key, const FrameInfo& info, FramePayload payload, std::shared_ptr<ImagePool> pool,
             std::shared_ptr<const Image> image)
    : info_(info),
      payload_(std::move(payload)),
      pool_(std::move(pool)),
      decoded_(image != nullptr),
      image_(std::move(image)) {}

FramePtr Frame::decoded(const FrameInfo& info, std::shared_ptr<const Image> image,
                        FramePayload payload, std::shared_ptr<ImagePool> pool) {
  SL_CHECK(image != nullptr, "a decoded frame has an image");
  SL_CHECK(image->width() == info.width && image->height() == info.height,
           "frame and image differ in size");
  return std::allocate_shared<const Frame>(RecyclingAllocator<Frame>(), Key(), info,
                                           std::move(payload), std::move(pool), std::move(image));
}

FramePtr Frame::raw(const FrameInfo& info, FramePayload payload, std::shared_ptr<ImagePool> pool) {
  const auto needed = raw_image_bytes(info.format, info.width, info.height, payload.stride);
  SL_CHECK(needed.has_value(), "the source passed a format or size that is no raw image");
  SL_CHECK(payload.bytes.size() >= *needed, "the source passed a payload that is too small");
  SL_CHECK(pool != nullptr, "a raw frame needs a pool for its image");
  return std::allocate_shared<const Frame>(RecyclingAllocator<Frame>(), Key(), info,
                                           std::move(payload), std::move(pool), nullptr);
}

FramePtr Frame::with_time_offset(const FramePtr& frame, Duration time_offset) {
  if (time_offset == Duration(0)) return frame;
  FrameInfo info = frame->info_;
  info.capture += time_offset;
  info.time_offset += time_offset;
  return std::allocate_shared<const Frame>(RecyclingAllocator<Frame>(), Key(), info,
                                           frame->payload_, frame->pool_,
                                           frame->decoded_ ? frame->image_ : nullptr);
}

FramePtr Frame::with_place(const FramePtr& frame, CameraPlacePtr place) {
  if (!place) return frame;
  FrameInfo info = frame->info_;
  info.place = std::move(place);
  // Who found out the place has looked at the image: it is not made twice.
  const bool there = frame->decoded_ || (frame->image_made_.load(std::memory_order_acquire) &&
                                         !luma_comes_first(info.format));
  return std::allocate_shared<const Frame>(RecyclingAllocator<Frame>(), Key(), info,
                                           frame->payload_, frame->pool_,
                                           there ? frame->image_ : nullptr);
}

I420View Frame::i420() const {
  std::call_once(image_once_, [this] {
    if (decoded_ || info_.format == PixelFormat::kI420) return;
    auto image = pool_->get();
    const Status status =
        raw_to_i420(info_.format, payload_.bytes, payload_.stride, image->mutable_view());
    SL_CHECK(status.has_value(), "raw() checked the sizes");
    image_ = std::move(image);
    image_made_.store(true, std::memory_order_release);
  });
  return image_ ? image_->view() : planes_of(info_, payload_);
}

void Frame::copy_i420_to(const MutableI420View& to) const {
  SL_CHECK(to.y.width == info_.width && to.y.height == info_.height,
           "frame and image differ in size");
  const bool there = decoded_ || info_.format == PixelFormat::kI420;
  if (there || image_made_.load(std::memory_order_acquire)) {
    copy_i420(i420(), to);
    return;
  }
  const Status status = raw_to_i420(info_.format, payload_.bytes, payload_.stride, to);
  SL_CHECK(status.has_value(), "raw() checked the sizes");
}

FramePtr Frame::copy_for(CameraId camera, std::shared_ptr<ImagePool> pool) const {
  const auto image = pool->get();
  copy_i420_to(image->mutable_view());
  FrameInfo info = info_;
  info.camera = camera;
  return decoded(info, image, {}, std::move(pool));
}

PlaneView Frame::gray() const {
  if (!decoded_ && luma_comes_first(info_.format)) return luma_of(info_, payload_);
  return i420().y;
}

PlaneView Frame::half_gray() const {
  const int width = info_.width / 2, height = info_.height / 2;
  if (width == 0 || height == 0) return {};
  std::call_once(half_once_, [&] {
    auto half = pool_ ? pool_->get_half() : std::make_shared<Image>(width, height);
    halve_plane(gray(), half->mutable_view().y);
    half_ = std::move(half);
  });
  return half_->view().y;
}

}  // namespace sightline
