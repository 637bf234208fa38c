// SPDX-License-Identifier: Apache-2.0
#include "pattern_check.hpp"

#include <algorithm>
#include <cstring>

#include "capture/decode/bayer_decoder.hpp"
#include "sightline/base/check.hpp"
#include "sightline/image/image.hpp"

namespace sightline::capture {
namespace {

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

bool same_plane(const PlaneView& a, const PlaneView& b, int width, int height) {
  for (int y = 0; y < height; ++y) {
    if (std::memcmp(a.row(y), b.row(y), static_cast<size_t>(width)) != 0) return false;
  }
  return true;
}

}  // namespace

PatternCheck::PatternCheck(const std::string& format, int width, int height)
    : wire_(gige::find_wire_format(format)),
      ours_(find_genicam_format(format)),
      width_(width),
      height_(height) {
  SL_CHECK(wire_ != nullptr && ours_ != nullptr, "the simulator has no such format");
}

int64_t PatternCheck::find(const Frame& frame) {
  for (uint64_t i = 0; i < gige::kPatternPeriod; ++i) {
    const uint64_t number = (next_ + i) % gige::kPatternPeriod;
    if (!equals(frame, number)) continue;
    next_ = number + 1;
    return static_cast<int64_t>(number);
  }
  return -2;
}

std::vector<uint8_t> PatternCheck::words(uint64_t number) const {
  std::vector<uint8_t> bytes;
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      const uint16_t value = gige::pattern_value(wire_->bits, x, y, number);
      bytes.push_back(static_cast<uint8_t>(value & 0xFF));
      if (wire_->bits > 8) bytes.push_back(static_cast<uint8_t>(value >> 8));
    }
  }
  return bytes;
}

bool PatternCheck::equals(const Frame& frame, uint64_t number) {
  if (ours_->bayer == BayerPattern::kNone) {
    if (ours_->packing == Packing::kNone) {
      gige::draw_pattern(*wire_, width_, height_, number, expected_);
    } else {
      expected_ = words(number);
    }
    return std::ranges::equal(frame.payload().bytes, expected_);
  }
  const BayerPacking samples = wire_->bits == 8    ? BayerPacking::k8
                               : wire_->bits == 10 ? BayerPacking::k10
                                                   : BayerPacking::k12;
  BayerDecoder decoder(pattern_of(ours_->bayer), samples, width_, height_);
  Image image(width_, height_);
  const ptrdiff_t stride = ptrdiff_t{width_} * (wire_->bits > 8 ? 2 : 1);
  const Status decoded = decoder.decode(words(number), stride, image.mutable_view());
  SL_CHECK(decoded.has_value(), "the words are complete");
  const I420View expected = image.view(), got = frame.i420();
  return same_plane(expected.y, got.y, width_, height_) &&
         same_plane(expected.u, got.u, width_ / 2, height_ / 2) &&
         same_plane(expected.v, got.v, width_ / 2, height_ / 2);
}

}  // namespace sightline::capture
