// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "sightline/base/result.hpp"
#include "sightline/image/planes.hpp"

namespace sightline::capture {

/// Decodes the single images of an MJPEG camera (libjpeg-turbo), strictly: data without start or
/// end marker, of another size than expected, or at which the decoder as much as warns is damaged.
/// 4:2:0 goes straight into the planes, other samplings through buffers that are kept. Colors come
/// out in limited range, as everywhere. One thread at a time; allocates only at first.
class MjpegDecoder {
 public:
  MjpegDecoder();
  ~MjpegDecoder();
  MjpegDecoder(const MjpegDecoder&) = delete;
  MjpegDecoder& operator=(const MjpegDecoder&) = delete;

  /// Fills `to`, whose size is the one expected; its pixels are undefined after an error
  /// (kDamaged). Zeros after the end marker are ignored: cameras pad.
  Status decode(std::span<const uint8_t> jpeg, const MutableI420View& to);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The image from start to end marker without the padding behind it; empty if either is missing.
std::span<const uint8_t> trim_jpeg(std::span<const uint8_t> bytes);

}  // namespace sightline::capture
