// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstring>

#include "observe/detect/pixels/scan_kernel.hpp"

namespace sightline::observe {
namespace {

// As wide as the processor that this file is compiled for has them; the sums are the same.
#ifdef __AVX2__
constexpr int kBytes = 32;
#else
constexpr int kBytes = 16;
#endif
using Bytes = uint8_t __attribute__((vector_size(kBytes)));

template <int kVectors>
inline bool sum_block(std::span<const uint8_t* const> features, ptrdiff_t at, uint8_t threshold,
                      uint8_t* sums) {
  Bytes sum[kVectors] = {};
  for (const uint8_t* feature : features) {
    for (int k = 0; k < kVectors; ++k) {
      Bytes responses;
      std::memcpy(&responses, feature + at + kBytes * k, sizeof responses);
      sum[k] += responses;
    }
  }
  Bytes any = {};
  for (int k = 0; k < kVectors; ++k) {
    std::memcpy(sums + at + kBytes * k, &sum[k], sizeof sum[k]);
    any |= (Bytes)(sum[k] >= threshold);
  }
  uint64_t words[kBytes / 8];
  std::memcpy(words, &any, sizeof words);
  uint64_t all = 0;
  for (const uint64_t word : words) all |= word;
  return all != 0;
}

inline bool sum_all(std::span<const uint8_t* const> features, int columns, uint8_t threshold,
                    uint8_t* sums) {
  bool any = false;
  int x = 0;
  for (; x + 160 <= columns; x += 160) {
    any |= sum_block<160 / kBytes>(features, x, threshold, sums);
  }
  for (; x < columns; x += 32) any |= sum_block<32 / kBytes>(features, x, threshold, sums);
  return any;
}

}  // namespace
}  // namespace sightline::observe
