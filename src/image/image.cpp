// SPDX-License-Identifier: Apache-2.0
#include "sightline/image/image.hpp"

#include <cstdlib>
#include <cstring>
#include <new>

#include "sightline/base/check.hpp"

namespace sightline {
namespace {

constexpr ptrdiff_t kAlignment = 64;
constexpr int kMaxSide = 32768;
constexpr uint8_t kBlackLuma = 16, kNeutralChroma = 128;

constexpr ptrdiff_t round_up(ptrdiff_t n) { return (n + kAlignment - 1) / kAlignment * kAlignment; }

}  // namespace

void Image::Free::operator()(uint8_t* p) const { std::free(p); }

Image::Image(int width, int height) {
  SL_CHECK(width > 0 && height > 0 && width <= kMaxSide && height <= kMaxSide,
           "image size out of range");
  const int chroma_width = (width + 1) / 2, chroma_height = (height + 1) / 2;
  const ptrdiff_t stride = round_up(width), chroma_stride = round_up(chroma_width);
  const ptrdiff_t luma_bytes = stride * height, chroma_bytes = chroma_stride * chroma_height;
  const auto total = static_cast<size_t>(luma_bytes + 2 * chroma_bytes);
  memory_.reset(static_cast<uint8_t*>(std::aligned_alloc(kAlignment, total)));
  if (!memory_) throw std::bad_alloc();
  uint8_t* const base = memory_.get();
  std::memset(base, kBlackLuma, static_cast<size_t>(luma_bytes));
  std::memset(base + luma_bytes, kNeutralChroma, static_cast<size_t>(2 * chroma_bytes));
  view_.y = {base, width, height, stride};
  view_.u = {base + luma_bytes, chroma_width, chroma_height, chroma_stride};
  view_.v = {base + luma_bytes + chroma_bytes, chroma_width, chroma_height, chroma_stride};
}

ImagePool::ImagePool(int width, int height, size_t keep_at_most)
    : width_(width), height_(height), full_(keep_at_most), half_(keep_at_most) {}

std::shared_ptr<Image> ImagePool::get() {
  return full_.get([this] { return std::make_unique<Image>(width_, height_); });
}

std::shared_ptr<Image> ImagePool::get_half() {
  return half_.get([this] { return std::make_unique<Image>(width_ / 2, height_ / 2); });
}

}  // namespace sightline
