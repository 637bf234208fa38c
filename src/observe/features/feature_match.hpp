// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>

#include "observe/features/orb_features.hpp"
#include "sightline/observe/features/feature_model.hpp"

namespace sightline::observe {

/// Bits that differ.
inline int bits_apart(const OrbDescriptor& a, const OrbDescriptor& b) {
  int bits = 0;
  for (size_t i = 0; i < a.size(); i += 8) {
    uint64_t x, y;
    std::memcpy(&x, &a[i], 8);
    std::memcpy(&y, &b[i], 8);
    bits += std::popcount(x ^ y);
  }
  return bits;
}

/// The trained feature that is nearest to a seen one by Hamming distance.
struct NearestTrained {
  static constexpr size_t kNone = std::numeric_limits<size_t>::max();
  size_t index = kNone;
  int bits = 257;   ///< that differ
  int other = 257;  ///< of the nearest one at another place of the object
};

/// `elsewhere` [m]: what counts as another place. One for every descriptor. The processor's own
/// instruction is used where it has one; the numbers are the same.
void match_features(std::span<const OrbFeature> seen, std::span<const TrainedFeature> trained,
                    float elsewhere, std::span<NearestTrained> out);
void match_features_scalar(std::span<const OrbFeature> seen,
                           std::span<const TrainedFeature> trained, float elsewhere,
                           std::span<NearestTrained> out);
void match_features_popcnt(std::span<const OrbFeature> seen,
                           std::span<const TrainedFeature> trained, float elsewhere,
                           std::span<NearestTrained> out);

}  // namespace sightline::observe
