// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "sightline/base/result.hpp"
#include "sightline/image/planes.hpp"

namespace sightline::capture {

/// Colors of the top-left 2x2 pixels, row by row.
enum class MosaicPattern : uint8_t { kRggb, kGrbg, kGbrg, kBggr };

/// How samples lie in memory: one byte; two bytes little-endian with the value in the low 10, 12 or
/// 16 bits; or MIPI packing (4 pixels in 5 bytes, 2 pixels in 3: high bytes first, then the rest).
enum class BayerPacking : uint8_t { k8, k10, k12, k16, kPacked10, kPacked12 };

/// Bytes of a row without padding.
size_t bayer_row_bytes(BayerPacking packing, int width);

/// The eight high bits of each sample of a row; low bits are below the noise of what follows.
void unpack_bayer_row(BayerPacking packing, const uint8_t* from, int width, uint8_t* to);

/// Color images from Bayer mosaics (OpenCV, bilinear). Keeps its buffers: allocates only at
/// first. One thread at a time.
class BayerDecoder {
 public:
  BayerDecoder(MosaicPattern pattern, BayerPacking packing, int width, int height);
  ~BayerDecoder();
  BayerDecoder(const BayerDecoder&) = delete;
  BayerDecoder& operator=(const BayerDecoder&) = delete;

  /// `bytes` holds all rows, `stride` apart; `to` has the size given at construction.
  Status decode(std::span<const uint8_t> bytes, ptrdiff_t stride, const MutableI420View& to);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace sightline::capture
