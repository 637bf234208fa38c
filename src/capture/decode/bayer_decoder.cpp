// SPDX-License-Identifier: Apache-2.0
#include "capture/decode/bayer_decoder.hpp"

#include <algorithm>
#include <cstring>
#include <exception>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "sightline/image/convert.hpp"

namespace sightline::capture {
namespace {

int color_code(MosaicPattern pattern) {
  switch (pattern) {
    case MosaicPattern::kRggb:
      return cv::COLOR_BayerBG2BGR;  // OpenCV names a pattern by its second row and column
    case MosaicPattern::kGrbg:
      return cv::COLOR_BayerGB2BGR;
    case MosaicPattern::kGbrg:
      return cv::COLOR_BayerGR2BGR;
    case MosaicPattern::kBggr:
      break;
  }
  return cv::COLOR_BayerRG2BGR;
}

void unpack_words(const uint8_t* from, int width, unsigned shift, uint8_t* to) {
  for (int x = 0; x < width; ++x) {
    const uint32_t value = from[2 * x] | static_cast<uint32_t>(from[2 * x + 1]) << 8;
    to[x] = static_cast<uint8_t>(std::min(value >> shift, 255u));
  }
}

// Groups of `Pixels` samples in `Bytes` bytes: the high bytes come first.
template <int Pixels, int Bytes>
void unpack_groups(const uint8_t* from, int width, uint8_t* to) {
  const int whole = width / Pixels;
  for (int group = 0; group < whole; ++group) {
    std::memcpy(to + group * Pixels, from + group * Bytes, Pixels);
  }
  for (int x = whole * Pixels; x < width; ++x) to[x] = from[whole * Bytes + x % Pixels];
}

}  // namespace

size_t bayer_row_bytes(BayerPacking packing, int width) {
  const auto n = static_cast<size_t>(width);
  switch (packing) {
    case BayerPacking::k8:
      return n;
    case BayerPacking::kPacked10:
      return (n * 10 + 7) / 8;
    case BayerPacking::kPacked12:
      return (n * 12 + 7) / 8;
    default:
      return 2 * n;
  }
}

void unpack_bayer_row(BayerPacking packing, const uint8_t* from, int width, uint8_t* to) {
  switch (packing) {
    case BayerPacking::k8:
      std::memcpy(to, from, static_cast<size_t>(width));
      return;
    case BayerPacking::k10:
      return unpack_words(from, width, 2, to);
    case BayerPacking::k12:
      return unpack_words(from, width, 4, to);
    case BayerPacking::k16:
      return unpack_words(from, width, 8, to);
    case BayerPacking::kPacked10:
      return unpack_groups<4, 5>(from, width, to);
    case BayerPacking::kPacked12:
      return unpack_groups<2, 3>(from, width, to);
  }
}

struct BayerDecoder::State {
  int code;
  BayerPacking packing;
  cv::Mat mosaic;
  cv::Mat color;
};

BayerDecoder::BayerDecoder(MosaicPattern pattern, BayerPacking packing, int width, int height)
    : state_(new State{color_code(pattern), packing, cv::Mat(height, width, CV_8UC1),
                       cv::Mat(height, width, CV_8UC3)}) {}

BayerDecoder::~BayerDecoder() = default;

Status BayerDecoder::decode(std::span<const uint8_t> bytes, ptrdiff_t stride,
                            const MutableI420View& to) {
  cv::Mat& mosaic = state_->mosaic;
  const size_t row = bayer_row_bytes(state_->packing, mosaic.cols);
  const auto needed = static_cast<size_t>(stride) * static_cast<size_t>(mosaic.rows - 1) + row;
  if (stride < static_cast<ptrdiff_t>(row) || bytes.size() < needed) {
    return make_error(ErrorCode::kDamaged, "", "Bayer image of {} bytes, {} are needed",
                      bytes.size(), needed);
  }
  for (int y = 0; y < mosaic.rows; ++y) {
    unpack_bayer_row(state_->packing, bytes.data() + y * stride, mosaic.cols, mosaic.ptr(y));
  }
  try {
    cv::cvtColor(mosaic, state_->color, state_->code);
  } catch (const std::exception& e) {
    return make_error(ErrorCode::kInternal, "", "OpenCV cannot convert the Bayer mosaic: {}",
                      e.what());
  }
  const cv::Mat& color = state_->color;
  return raw_to_i420(PixelFormat::kBgr24, {color.data, color.total() * color.elemSize()},
                     static_cast<ptrdiff_t>(color.step), to);
}

}  // namespace sightline::capture
