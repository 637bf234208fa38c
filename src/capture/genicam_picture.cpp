// SPDX-License-Identifier: Apache-2.0
#include "genicam_picture.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "demosaic.hpp"
#include "sightline/base/check.hpp"
#include "sightline/image/convert.hpp"

namespace sightline {
namespace {

size_t pixels(int width, int height) {
  return static_cast<size_t>(width) * static_cast<size_t>(height);
}

uint8_t* start(std::vector<uint8_t>& bytes) { return bytes.data(); }

}  // namespace

GenicamPicture::GenicamPicture(const GenicamFormat& format, int width, int height, int padding)
    : format_(&format),
      width_(width),
      height_(height),
      padding_(padding),
      stride_(static_cast<ptrdiff_t>(genicam_row_bytes(format, width)) + padding),
      pictures_(std::make_shared<PicturePool>(width, height)),
      copies_(static_cast<size_t>(stride_) * static_cast<size_t>(height)),
      words_(pixels(width, height) * 2) {
  SL_CHECK(stride_ > padding, "the caller checked that a row ends on a byte");
  if (format.bayer == BayerPattern::kNone) return;
  row_.resize(static_cast<size_t>(width));
  if (format.bits > 8) mosaic_.resize(pixels(width, height));
  bgr_.resize(pixels(width, height) * 3);
}

size_t GenicamPicture::bytes_needed() const {
  const auto stride = static_cast<size_t>(stride_);
  return stride * static_cast<size_t>(height_) - static_cast<size_t>(padding_);
}

FramePtr GenicamPicture::frame(FrameInfo info, std::span<const uint8_t> bytes,
                               std::shared_ptr<const void> owner) {
  SL_CHECK(bytes.size() >= bytes_needed(), "the caller checked the size");
  info.format = format_->format;
  info.width = width_;
  info.height = height_;
  if (format_->bayer != BayerPattern::kNone) return demosaiced(info, bytes.data());
  if (format_->packing != Packing::kNone) return unpacked(info, bytes.data());
  FramePayload payload;
  payload.bytes = bytes.first(bytes_needed());
  payload.stride = stride_;
  payload.owner = std::move(owner);
  return Frame::raw(info, std::move(payload), pictures_);
}

FramePtr GenicamPicture::copied_frame(const FrameInfo& info, std::span<const uint8_t> bytes) {
  if (!format_->direct()) return frame(info, bytes, nullptr);  // makes a copy in any case
  const std::shared_ptr<uint8_t> copy = copies_.get();
  std::memcpy(copy.get(), bytes.data(), bytes_needed());
  return frame(info, {copy.get(), bytes_needed()}, copy);
}

FramePtr GenicamPicture::unpacked(const FrameInfo& info, const uint8_t* bytes) {
  const std::shared_ptr<uint8_t> words = words_.get();
  // operator new aligns for any fundamental type.
  auto* const to = reinterpret_cast<uint16_t*>(words.get());
  for (int y = 0; y < height_; ++y) {
    unpack_row(format_->packing, format_->bits, bytes + y * stride_, width_,
               to + ptrdiff_t{y} * width_);
  }
  FramePayload payload;
  payload.bytes = {words.get(), words_.size()};
  payload.stride = ptrdiff_t{width_} * 2;
  payload.owner = words;
  return Frame::raw(info, std::move(payload), pictures_);
}

// The mosaic with eight bits a sample, rows `stride_` (8-bit formats) or width_ bytes apart.
const uint8_t* GenicamPicture::eight_bit(const uint8_t* bytes) {
  if (format_->bits == 8) return bytes;
  const int shift = format_->bits - 8;
  for (int y = 0; y < height_; ++y) {
    const uint8_t* const from = bytes + y * stride_;
    uint8_t* const to = start(mosaic_) + ptrdiff_t{y} * width_;
    if (format_->packing == Packing::kNone) {
      std::memcpy(row_.data(), from, row_.size() * 2);
    } else {
      unpack_row(format_->packing, format_->bits, from, width_, row_.data());
    }
    std::transform(row_.begin(), row_.end(), to, [shift](uint16_t sample) {
      return static_cast<uint8_t>(std::min(sample >> shift, 255));
    });
  }
  return mosaic_.data();
}

FramePtr GenicamPicture::demosaiced(const FrameInfo& info, const uint8_t* bytes) {
  const ptrdiff_t stride = format_->bits == 8 ? stride_ : width_;
  demosaic_to_bgr(format_->bayer, {eight_bit(bytes), width_, height_, stride}, bgr_.data());
  const std::shared_ptr<Picture> picture = pictures_->get();
  const Status converted =
      raw_to_i420(PixelFormat::kBgr24, bgr_, ptrdiff_t{width_} * 3, picture->mutable_view());
  SL_CHECK(converted.has_value(), "the buffer was made for this size");
  return Frame::decoded(info, picture, {}, pictures_);
}

}  // namespace sightline
