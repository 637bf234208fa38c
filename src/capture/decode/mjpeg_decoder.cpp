// SPDX-License-Identifier: Apache-2.0
#include "capture/decode/mjpeg_decoder.hpp"

#include <turbojpeg.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <vector>

#include "sightline/base/check.hpp"

namespace sightline::capture {
namespace {

constexpr uint8_t kNeutralChroma = 128;

// JPEG's 0..255 into 16..235 (luma) and 16..240 (chroma), rounded to nearest; luma is the
// arithmetic of convert.cpp, which the compiler vectorizes.
constexpr uint8_t limited_chroma(unsigned value) {
  return static_cast<uint8_t>((value * 224u + 128u * 255u - 128u * 224u + 127u) / 255u);
}

void compress_luma(const PlaneView& from, const MutablePlaneView& to) {
  for (int y = 0; y < to.height; ++y) {
    const uint8_t* const in = from.row(y);
    uint8_t* const out = to.row(y);
    for (int x = 0; x < to.width; ++x) {
      out[x] = static_cast<uint8_t>(16u + (in[x] * 219u + 127u) / 255u);
    }
  }
}

// Averages boxes of step_x by step_y samples; at the edge the last sample counts again.
void compress_chroma(const PlaneView& from, int step_x, int step_y, const MutablePlaneView& to) {
  for (int y = 0; y < to.height; ++y) {
    const uint8_t* const top = from.row(std::min(y * step_y, from.height - 1));
    const uint8_t* const bottom = from.row(std::min(y * step_y + step_y - 1, from.height - 1));
    uint8_t* const out = to.row(y);
    if (step_x == 1) {
      for (int x = 0; x < to.width; ++x) out[x] = limited_chroma((top[x] + bottom[x] + 1u) / 2);
    } else {
      for (int x = 0; x < to.width; ++x) {
        const int a = std::min(2 * x, from.width - 1), b = std::min(2 * x + 1, from.width - 1);
        out[x] = limited_chroma((top[a] + top[b] + bottom[a] + bottom[b] + 2u) / 4);
      }
    }
  }
}

void fill(const MutablePlaneView& plane, uint8_t value) {
  for (int y = 0; y < plane.height; ++y) {
    std::memset(plane.row(y), value, static_cast<size_t>(plane.width));
  }
}

MutablePlaneView plane_of(std::vector<uint8_t>& memory, int component, int width, int height,
                          int sampling) {
  const int w = tjPlaneWidth(component, width, sampling);
  const int h = tjPlaneHeight(component, height, sampling);
  memory.resize(static_cast<size_t>(w) * static_cast<size_t>(h));
  return {memory.data(), w, h, w};
}

Error damaged(const char* what) {
  return make_error(ErrorCode::kDamaged, "", "damaged MJPEG image: {}", what);
}

}  // namespace

struct MjpegDecoder::State {
  tjhandle turbo = tjInitDecompress();
  std::array<std::vector<uint8_t>, 3> planes;
  ~State() { tjDestroy(turbo); }
};

MjpegDecoder::MjpegDecoder() : state_(std::make_unique<State>()) {
  SL_CHECK(state_->turbo != nullptr, "TurboJPEG has no memory for a decoder");
}

MjpegDecoder::~MjpegDecoder() = default;

std::span<const uint8_t> trim_jpeg(std::span<const uint8_t> bytes) {
  size_t end = bytes.size();
  while (end > 0 && bytes[end - 1] == 0) --end;
  if (end < 4 || bytes[0] != 0xff || bytes[1] != 0xd8) return {};
  if (bytes[end - 2] != 0xff || bytes[end - 1] != 0xd9) return {};
  return bytes.first(end);
}

Status MjpegDecoder::decode(std::span<const uint8_t> bytes, const MutableI420View& to) {
  const auto jpeg = trim_jpeg(bytes);
  if (jpeg.empty()) return damaged("no start or end marker (truncated in transfer)");
  int width = 0, height = 0, sampling = 0, colors = 0;
  if (tjDecompressHeader3(state_->turbo, jpeg.data(), jpeg.size(), &width, &height, &sampling,
                          &colors) != 0) {
    return damaged(tjGetErrorStr2(state_->turbo));
  }
  if (width != to.width() || height != to.height()) return damaged("it has another size");
  const bool gray = sampling == TJSAMP_GRAY;
  if (colors != (gray ? TJCS_GRAY : TJCS_YCbCr)) return damaged("its colors are not YCbCr");
  if (sampling != TJSAMP_420 && sampling != TJSAMP_422 && sampling != TJSAMP_444 &&
      sampling != TJSAMP_440 && !gray) {
    return damaged("its color sampling is not supported");
  }

  // TurboJPEG rounds planes of odd height up, for which the image has no room.
  const bool direct = sampling == TJSAMP_420 && width % 2 == 0 && height % 2 == 0;
  std::array<MutablePlaneView, 3> planes{to.y, to.u, to.v};
  const int count = gray ? 1 : 3;
  if (!direct) {
    for (int i = 0; i < count; ++i) {
      const auto n = static_cast<size_t>(i);
      planes[n] = plane_of(state_->planes[n], i, width, height, sampling);
    }
  }
  std::array<uint8_t*, 3> data{};
  std::array<int, 3> strides{};
  for (size_t i = 0; i < static_cast<size_t>(count); ++i) {
    data[i] = planes[i].data;
    strides[i] = static_cast<int>(planes[i].stride);
  }
  if (tjDecompressToYUVPlanes(state_->turbo, jpeg.data(), jpeg.size(), data.data(), width,
                              strides.data(), height,
                              TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS) != 0) {
    return damaged(tjGetErrorStr2(state_->turbo));
  }
  compress_luma(as_const(planes[0]), to.y);
  if (gray) {
    fill(to.u, kNeutralChroma);
    fill(to.v, kNeutralChroma);
    return {};
  }
  const int step_x = sampling == TJSAMP_444 || sampling == TJSAMP_440 ? 2 : 1;
  const int step_y = sampling == TJSAMP_444 || sampling == TJSAMP_422 ? 2 : 1;
  compress_chroma(as_const(planes[1]), step_x, step_y, to.u);
  compress_chroma(as_const(planes[2]), step_x, step_y, to.v);
  return {};
}

}  // namespace sightline::capture
