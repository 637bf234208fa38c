// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/raster/tile.hpp"

#include <cstring>
#include <new>

#include "sightline/base/check.hpp"

namespace sightline {
namespace {

constexpr std::align_val_t kAlignment{64};

}  // namespace

void RasterTile::Free::operator()(void* p) const { ::operator delete(p, kAlignment); }

void RasterTile::reset(const TileRect& rect, bool faces) {
  SL_CHECK(rect.width >= 0 && rect.height >= 0 && rect.width < (1 << 20) && rect.height < (1 << 20),
           "tile size");
  rect_ = rect;
  stride_ = (static_cast<size_t>(rect.width) + 7) / 8 * 8;
  const size_t size = stride_ * static_cast<size_t>(rect.height);
  if (size > capacity_) {
    capacity_ = size;
    depth_.reset(static_cast<float*>(::operator new((size + kSlack) * sizeof(float), kAlignment)));
    shade_.reset(static_cast<uint8_t*>(::operator new(size + kSlack, kAlignment)));
  }
  has_faces_ = faces;
  if (faces && size > face_capacity_) {
    face_capacity_ = size;
    face_.reset(
        static_cast<uint32_t*>(::operator new((size + kSlack) * sizeof(uint32_t), kAlignment)));
  }
  if (size == 0) return;
  std::memset(depth_.get(), 0, size * sizeof(float));
  std::memset(shade_.get(), 0, size);
  static_assert(kNoFace == 0xffffffff, "all bytes alike");
  if (faces) std::memset(face_.get(), 0xff, size * sizeof(uint32_t));
}

}  // namespace sightline
