// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "observe/features/feature_match.hpp"
#include "sightline/base/vectors.hpp"

namespace sightline::observe {
namespace {

// Its own copy for each processor: an inline function shared with other files would be one of them.
inline int bits_between(const OrbDescriptor& a, const OrbDescriptor& b) {
  return vectors::bits_set<sizeof(OrbDescriptor) / 8>(&a, &b, [](auto x, auto y) { return x ^ y; });
}

inline NearestTrained nearest_to(const OrbFeature& seen, std::span<const TrainedFeature> trained,
                                 float elsewhere) {
  NearestTrained best;
  float x = 0, y = 0, z = 0;
  for (size_t i = 0; i < trained.size(); ++i) {
    const int bits = bits_between(seen.descriptor, trained[i].descriptor);
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
