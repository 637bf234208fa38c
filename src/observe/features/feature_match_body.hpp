// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "observe/features/feature_match.hpp"

namespace sightline::observe {
namespace {

// Its own copy for each processor: an inline function shared with other files would be one of them.
inline int bits_between(const uint8_t* a, const uint8_t* b) {
  int bits = 0;
  for (size_t i = 0; i < sizeof(OrbDescriptor); i += 8) {
    uint64_t x, y;
    std::memcpy(&x, a + i, 8);
    std::memcpy(&y, b + i, 8);
    bits += __builtin_popcountll(x ^ y);
  }
  return bits;
}

inline NearestTrained nearest_to(const OrbFeature& seen, std::span<const TrainedFeature> trained,
                                 float elsewhere) {
  NearestTrained best;
  float x = 0, y = 0, z = 0;
  for (size_t i = 0; i < trained.size(); ++i) {
    const int bits = bits_between(&seen.descriptor[0], &trained[i].descriptor[0]);
    if (bits >= best.other) continue;
    const float* point = trained[i].point.data();
    const float dx = point[0] - x, dy = point[1] - y, dz = point[2] - z;
    const bool near =
        best.index != NearestTrained::kNone && dx * dx + dy * dy + dz * dz < elsewhere * elsewhere;
    if (bits < best.bits) {
      if (!near) best.other = best.bits;
      best.bits = bits;
      best.index = i;
      x = point[0], y = point[1], z = point[2];
    } else if (!near) {
      best.other = bits;
    }
  }
  return best;
}

}  // namespace
}  // namespace sightline::observe
