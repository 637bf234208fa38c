// SPDX-License-Identifier: Apache-2.0
#include "sightline/image/picture.hpp"

#include <cstdlib>
#include <cstring>
#include <new>

#include "sightline/base/check.hpp"
#include "sightline/base/recycling_allocator.hpp"

namespace sightline {
namespace {

constexpr ptrdiff_t kAlignment = 64;
constexpr int kMaxSide = 32768;
constexpr uint8_t kBlackLuma = 16, kNeutralChroma = 128;

constexpr ptrdiff_t round_up(ptrdiff_t n) { return (n + kAlignment - 1) / kAlignment * kAlignment; }

}  // namespace

void Picture::Free::operator()(uint8_t* p) const { std::free(p); }

Picture::Picture(int width, int height) {
  SL_CHECK(width > 0 && height > 0 && width <= kMaxSide && height <= kMaxSide,
           "picture size out of range");
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

// Pictures out of use. Held by the pool and by every picture that is out, so the last picture may
// come home after the pool is gone.
struct PicturePool::Shared {
  Shared(int w, int h, size_t keep) : width(w), height(h), keep_at_most(keep) {
    pictures.reserve(keep);
  }

  void give_back(Picture* picture) {
    std::unique_ptr<Picture> owned(picture);
    std::lock_guard lock(mutex);
    if (pictures.size() < keep_at_most) pictures.push_back(std::move(owned));
  }

  const int width, height;
  const size_t keep_at_most;
  mutable std::mutex mutex;
  std::vector<std::unique_ptr<Picture>> pictures;
  size_t allocated = 0;
  std::unique_ptr<PicturePool> half;
};

PicturePool::PicturePool(int width, int height, size_t keep_at_most)
    : shared_(std::make_shared<Shared>(width, height, keep_at_most)) {}

std::shared_ptr<Picture> PicturePool::get() {
  std::unique_ptr<Picture> picture;
  {
    std::lock_guard lock(shared_->mutex);
    if (shared_->pictures.empty()) {
      ++shared_->allocated;
    } else {
      picture = std::move(shared_->pictures.back());
      shared_->pictures.pop_back();
    }
  }
  if (!picture) picture = std::make_unique<Picture>(shared_->width, shared_->height);
  return std::shared_ptr<Picture>(
      picture.release(), [shared = shared_](Picture* p) { shared->give_back(p); },
      RecyclingAllocator<Picture>());
}

std::shared_ptr<Picture> PicturePool::get_half() {
  PicturePool* half = nullptr;
  {
    std::lock_guard lock(shared_->mutex);
    if (!shared_->half) {
      shared_->half = std::make_unique<PicturePool>(shared_->width / 2, shared_->height / 2,
                                                    shared_->keep_at_most);
    }
    half = shared_->half.get();
  }
  return half->get();
}

size_t PicturePool::allocated() const {
  std::lock_guard lock(shared_->mutex);
  return shared_->allocated + (shared_->half ? shared_->half->allocated() : 0);
}

}  // namespace sightline
