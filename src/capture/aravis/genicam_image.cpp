// SPDX-License-Identifier: Apache-2.0
#include "capture/aravis/genicam_image.hpp"

#include <cstring>
#include <utility>

#include "sightline/base/check.hpp"

namespace sightline::capture {
namespace {

size_t pixels(int width, int height) {
  return static_cast<size_t>(width) * static_cast<size_t>(height);
}

MosaicPattern pattern_of(BayerPattern bayer) {
  switch (bayer) {
    case BayerPattern::kGr:
      return MosaicPattern::kGrbg;
    case BayerPattern::kGb:
      return MosaicPattern::kGbrg;
    case BayerPattern::kBg:
      return MosaicPattern::kBggr;
    default:
      return MosaicPattern::kRggb;
  }
}

// Of the samples once they are unpacked.
BayerPacking samples_of(const GenicamFormat& format) {
  switch (format.bits) {
    case 8:
      return BayerPacking::k8;
    case 10:
      return BayerPacking::k10;
    case 12:
      return BayerPacking::k12;
    default:
      return BayerPacking::k16;
  }
}

}  // namespace

GenicamImage::GenicamImage(const GenicamFormat& format, int width, int height, int padding)
    : format_(&format),
      width_(width),
      height_(height),
      padding_(padding),
      stride_(static_cast<ptrdiff_t>(genicam_row_bytes(format, width)) + padding),
      images_(std::make_shared<ImagePool>(width, height)),
      copies_(static_cast<size_t>(stride_) * static_cast<size_t>(height)),
      words_(pixels(width, height) * 2) {
  SL_CHECK(stride_ > padding, "the caller checked that a row ends on a byte");
  if (format.bayer == BayerPattern::kNone) return;
  bayer_ =
      std::make_unique<BayerDecoder>(pattern_of(format.bayer), samples_of(format), width, height);
  if (format.packing != Packing::kNone) mosaic_.resize(words_.size());
}

size_t GenicamImage::bytes_needed() const {
  const auto stride = static_cast<size_t>(stride_);
  return stride * static_cast<size_t>(height_) - static_cast<size_t>(padding_);
}

FramePtr GenicamImage::frame(FrameInfo info, std::span<const uint8_t> bytes,
                             std::shared_ptr<const void> owner) {
  SL_CHECK(bytes.size() >= bytes_needed(), "the caller checked the size");
  info.format = format_->format;
  info.width = width_;
  info.height = height_;
  if (format_->bayer != BayerPattern::kNone) return demosaiced(info, bytes);
  if (format_->packing != Packing::kNone) return unpacked(info, bytes.data());
  FramePayload payload;
  payload.bytes = bytes.first(bytes_needed());
  payload.stride = stride_;
  payload.owner = std::move(owner);
  return Frame::raw(info, std::move(payload), images_);
}

FramePtr GenicamImage::copied_frame(const FrameInfo& info, std::span<const uint8_t> bytes) {
  if (!format_->direct()) return frame(info, bytes, nullptr);  // makes a copy in any case
  const std::shared_ptr<uint8_t> copy = copies_.get();
  std::memcpy(copy.get(), bytes.data(), bytes_needed());
  return frame(info, {copy.get(), bytes_needed()}, copy);
}

void GenicamImage::unpack(const uint8_t* bytes, uint8_t* words) const {
  // operator new aligns for any fundamental type.
  auto* const to = reinterpret_cast<uint16_t*>(words);
  for (int y = 0; y < height_; ++y) {
    unpack_row(format_->packing, format_->bits, bytes + y * stride_, width_,
               to + ptrdiff_t{y} * width_);
  }
}

FramePtr GenicamImage::unpacked(const FrameInfo& info, const uint8_t* bytes) {
  const std::shared_ptr<uint8_t> words = words_.get();
  unpack(bytes, words.get());
  FramePayload payload;
  payload.bytes = {words.get(), words_.size()};
  payload.stride = ptrdiff_t{width_} * 2;
  payload.owner = words;
  return Frame::raw(info, std::move(payload), images_);
}

FramePtr GenicamImage::demosaiced(const FrameInfo& info, std::span<const uint8_t> bytes) {
  ptrdiff_t stride = stride_;
  if (format_->packing != Packing::kNone) {
    unpack(bytes.data(), mosaic_.data());
    bytes = mosaic_;
    stride = ptrdiff_t{width_} * 2;
  }
  const std::shared_ptr<Image> image = images_->get();
  const Status decoded = bayer_->decode(bytes, stride, image->mutable_view());
  SL_CHECK(decoded.has_value(), decoded.error().text);
  return Frame::decoded(info, image, {}, images_);
}

}  // namespace sightline::capture
