// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "sightline/image/planes.hpp"

namespace sightline::capture {

/// How samples of 10 and 12 bits share bytes.
enum class Packing : uint8_t {
  kNone,       ///< whole bytes
  kGige,       ///< "Mono12Packed": two samples in three bytes, the middle one holds both low parts
  kBitStream,  ///< "Mono12p": least significant bit first, no gaps
};

enum class BayerPattern : uint8_t { kNone, kRg, kGr, kGb, kBg };

/// A pixel format of GenICam (Pixel Format Naming Convention, EMVA).
struct GenicamFormat {
  std::string_view name;
  uint32_t code = 0;  ///< as it travels in the stream's leader
  Packing packing = Packing::kNone;
  int bits = 8;  ///< of a sample
  BayerPattern bayer = BayerPattern::kNone;
  PixelFormat format = PixelFormat::kGray;  ///< of the frames; I420 for Bayer

  /// The bytes are frames as they come.
  bool direct() const { return packing == Packing::kNone && bayer == BayerPattern::kNone; }
};

/// All that can be used; the best for a live image first.
std::span<const GenicamFormat> genicam_formats();
/// nullptr: not one of ours.
const GenicamFormat* find_genicam_format(uint32_t code);
const GenicamFormat* find_genicam_format(std::string_view name);

/// Bytes of one row without padding. A packed row must end on a byte: 0 if it does not.
size_t genicam_row_bytes(const GenicamFormat& format, int width);

/// One row of 10- or 12-bit packed samples into 16-bit words, value in the low bits. `from` holds
/// genicam_row_bytes(); `to` holds `width` words.
void unpack_row(Packing packing, int bits, const uint8_t* from, int width, uint16_t* to);

}  // namespace sightline::capture
