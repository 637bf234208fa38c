// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/image/planes.hpp"

namespace sightline::capture {

/// Decodes images that come in a buffer each (MJPEG, Bayer). One thread at a time.
class ImageDecoder {
 public:
  virtual ~ImageDecoder() = default;
  /// Fills `to` from the bytes of one buffer; its pixels are undefined after an error (kDamaged).
  virtual Status decode(std::span<const uint8_t> bytes, const MutableI420View& to) = 0;
  /// What of the bytes goes on beside the image, for recording; empty: nothing.
  virtual std::span<const uint8_t> payload(std::span<const uint8_t> bytes) const = 0;
};

/// Decodes a stream of access units whose images are predicted from one another (H.264). Images
/// come out in order, each with the number of its access unit; units that cannot be decoded have
/// none. One thread at a time.
class AccessUnitDecoder {
 public:
  virtual ~AccessUnitDecoder() = default;
  /// Whether decoding can begin with this unit.
  virtual bool can_begin(std::span<const uint8_t> unit) const = 0;
  /// `number` grows from unit to unit. The bytes are copied.
  virtual Status push(std::span<const uint8_t> unit, uint64_t number) = 0;
  /// Waits for the next image and writes it to `to`; its number, or nullopt at the limit.
  /// kDamaged: an image of another size; kInternal: the decoder gave up.
  virtual Result<std::optional<uint64_t>> pull(Duration limit, const MutableI420View& to) = 0;
};

/// At most one of the two; without, frames are raw.
struct FrameDecoders {
  std::unique_ptr<ImageDecoder> image;
  std::unique_ptr<AccessUnitDecoder> access_unit;
};

}  // namespace sightline::capture
