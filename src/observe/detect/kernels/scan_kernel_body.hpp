// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstring>

#include "observe/detect/kernels/scan_kernel.hpp"
#include "sightline/base/vectors.hpp"

namespace sightline::observe {
namespace {

// As wide as the processor that this file is compiled for has them; the sums are the same.
using vectors::Bytes;
using vectors::kBytes;
constexpr int kBlock = 64;  // columns: wider ones are seldom left out, shorter ones cost more
constexpr size_t kMostOfFeature = 8;  // its response

template <int kVectors>
inline bool any_reaches(const Bytes (&sum)[kVectors], uint8_t threshold) {
  Bytes reached = {};
  for (int k = 0; k < kVectors; ++k) reached |= (Bytes)(sum[k] >= threshold);
  return vectors::any(reached);
}

template <int kVectors>
inline void add_features(std::span<const uint8_t* const> features, ptrdiff_t at,
                         Bytes (&sum)[kVectors]) {
#pragma GCC unroll 8
  for (const uint8_t* feature : features) {
    for (int k = 0; k < kVectors; ++k) {
      Bytes responses;
      std::memcpy(&responses, feature + at + kBytes * k, sizeof responses);
      sum[k] += responses;
    }
  }
}

// Where the first features leave too little for the others to make up for, those are not read: the
// sums are zero then, instead of something below the threshold.
template <int kVectors>
inline bool sum_block(std::span<const uint8_t* const> features, ptrdiff_t at, uint8_t threshold,
                      uint8_t* to) {
  Bytes sum[kVectors] = {};
  const size_t first = features.size() / 2;
  const size_t most_of_rest = kMostOfFeature * (features.size() - first);
  add_features(features.first(first), at, sum);
  if (threshold > most_of_rest &&
      !any_reaches(sum, static_cast<uint8_t>(threshold - most_of_rest))) {
    std::memset(to, 0, sizeof sum);
    return false;
  }
  add_features(features.subspan(first), at, sum);
  for (int k = 0; k < kVectors; ++k) std::memcpy(to + kBytes * k, &sum[k], sizeof sum[k]);
  return any_reaches(sum, threshold);
}

inline bool sum_all(std::span<const uint8_t* const> features, ptrdiff_t offset, int columns,
                    uint8_t threshold, uint8_t* sums) {
  bool any = false;
  int x = 0;
  for (; x + kBlock <= columns; x += kBlock) {
    any |= sum_block<kBlock / kBytes>(features, offset + x, threshold, sums + x);
  }
  for (; x < columns; x += 32)
    any |= sum_block<32 / kBytes>(features, offset + x, threshold, sums + x);
  return any;
}

}  // namespace
}  // namespace sightline::observe
