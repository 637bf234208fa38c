// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <bit>

#include "observe/features/feature_match.hpp"
#include "sightline/base/vectors.hpp"

namespace sightline::observe {
namespace {

// Its own copy for each processor: an inline function shared with other files would be one of them.
template <typename Bytes>
inline int bits_between(const Bytes& a, const Bytes& b) {
  return vectors::bits_set<sizeof(Bytes) / 8>(&a, &b, [](auto x, auto y) { return x ^ y; });
}

constexpr size_t kBlock = TrainedDescriptors::kBlock;
constexpr size_t kBlocksInCache = 16;  // of all features that are looked for, one after the other

// Those of the block from `first` whose first half may be this one's, a bit each: without a branch,
// which nobody could predict.
inline uint64_t alike(const DescriptorHalf& seen, const TrainedDescriptors& trained, size_t first) {
  const DescriptorHalf* const block = trained.first_halves(first);
  uint64_t out = 0;
#pragma GCC unroll 64
  for (size_t i = 0; i < kBlock; ++i) {
    out |= static_cast<uint64_t>(bits_between(seen, block[i]) <= kMaxBitsOfHalf) << i;
  }
  return out;
}

inline void compare(const OrbFeature& seen, const TrainedDescriptors& trained, size_t i,
                    float elsewhere, NearestTrained& best) {
  const int bits = bits_between(seen.descriptor, trained.descriptor(i));
  if (bits >= best.other) return;
  const bool near =
      best.index != NearestTrained::kNone &&
      (trained.point(i) - trained.point(best.index)).squaredNorm() < elsewhere * elsewhere;
  if (bits < best.bits) {
    if (!near) best.other = best.bits;
    best.bits = bits;
    best.index = i;
  } else if (!near) {
    best.other = bits;
  }
}

inline void find_nearest(std::span<const OrbFeature> seen, const TrainedDescriptors& trained,
                         float elsewhere, std::span<NearestTrained> out) {
  std::fill_n(out.begin(), seen.size(), NearestTrained());
  for (size_t group = 0; group < trained.size(); group += kBlocksInCache * kBlock) {
    const size_t end = std::min(trained.size(), group + kBlocksInCache * kBlock);
    for (size_t k = 0; k < seen.size(); ++k) {
      DescriptorHalf half;
      std::copy_n(seen[k].descriptor.begin(), half.size(), half.begin());
      for (size_t first = group; first < end; first += kBlock) {
        for (uint64_t left = alike(half, trained, first); left != 0; left &= left - 1) {
          const size_t i = first + static_cast<size_t>(std::countr_zero(left));
          if (i < trained.size()) compare(seen[k], trained, i, elsewhere, out[k]);
        }
      }
    }
  }
}

}  // namespace
}  // namespace sightline::observe
