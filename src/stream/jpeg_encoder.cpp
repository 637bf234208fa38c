// SPDX-License-Identifier: Apache-2.0
#include "sightline/stream/jpeg_encoder.hpp"

#include <turbojpeg.h>

#include <algorithm>
#include <optional>

#include "sightline/image/image.hpp"

namespace sightline {
namespace {

// 16..235 to 0..255, in 16 bits, so that the compiler does sixteen at once.
void expand_luma(const PlaneView& from, const MutablePlaneView& to) {
  for (int y = 0; y < from.height; ++y) {
    const uint8_t* const in = from.row(y);
    uint8_t* const out = to.row(y);
    for (int x = 0; x < from.width; ++x) {
      const auto level = static_cast<uint16_t>(std::clamp<uint8_t>(in[x], 16, 235) - 16);
      out[x] = static_cast<uint8_t>(static_cast<uint16_t>(level * 298 + 128) >> 8);
    }
  }
}

// 16..240 about 128 to 0..255 about 128.
void expand_chroma(const PlaneView& from, const MutablePlaneView& to) {
  for (int y = 0; y < from.height; ++y) {
    const uint8_t* const in = from.row(y);
    uint8_t* const out = to.row(y);
    for (int x = 0; x < from.width; ++x) {
      const auto level = static_cast<uint16_t>(std::clamp<uint8_t>(in[x], 16, 240) - 16);
      out[x] = static_cast<uint8_t>(static_cast<uint16_t>(level * 291 + 256) >> 8);
    }
  }
}

struct Destroy {
  void operator()(void* handle) const { tjDestroy(handle); }
};

}  // namespace

struct JpegEncoder::Impl {
  std::unique_ptr<void, Destroy> handle;
  int quality = 80;
  std::optional<Image> full_range;
  unsigned char* buffer = nullptr;  ///< of the library, which makes it larger where it has to
  unsigned long capacity = 0;

  ~Impl() { tjFree(buffer); }
};

JpegEncoder::JpegEncoder(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
JpegEncoder::~JpegEncoder() = default;

Result<std::unique_ptr<JpegEncoder>> JpegEncoder::create(int quality) {
  if (quality < 1 || quality > 100) {
    return make_error(ErrorCode::kInvalidInput, "", "a JPEG quality is from 1 to 100, not {}",
                      quality);
  }
  auto impl = std::make_unique<Impl>();
  impl->quality = quality;
  impl->handle.reset(tjInitCompress());
  if (!impl->handle) {
    return make_error(ErrorCode::kInternal, "", "the JPEG library does not start: {}",
                      tjGetErrorStr2(nullptr));
  }
  return std::unique_ptr<JpegEncoder>(new JpegEncoder(std::move(impl)));
}

Result<std::string> JpegEncoder::encode(const I420View& image) {
  auto& full = impl_->full_range;
  if (!full || full->width() != image.width() || full->height() != image.height()) {
    full.emplace(image.width(), image.height());
  }
  const MutableI420View to = full->mutable_view();
  expand_luma(image.y, to.y);
  expand_chroma(image.u, to.u);
  expand_chroma(image.v, to.v);
  const unsigned char* planes[] = {to.y.data, to.u.data, to.v.data};
  const int strides[] = {static_cast<int>(to.y.stride), static_cast<int>(to.u.stride),
                         static_cast<int>(to.v.stride)};
  unsigned long size = impl_->capacity;
  const int failed =
      tjCompressFromYUVPlanes(impl_->handle.get(), planes, image.width(), strides, image.height(),
                              TJSAMP_420, &impl_->buffer, &size, impl_->quality, TJFLAG_FASTDCT);
  if (failed != 0) {
    return make_error(ErrorCode::kInternal, "", "the JPEG library refuses the image: {}",
                      tjGetErrorStr2(impl_->handle.get()));
  }
  impl_->capacity = std::max(impl_->capacity, size);
  return std::string(reinterpret_cast<const char*>(impl_->buffer), size);
}

}  // namespace sightline
