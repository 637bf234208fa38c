// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <vector>

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

/// Of what differs in more bits of its first half nothing else is compared: two thirds of the time.
/// What a match differs in, 70 bits at most, is 35 of the first half, give or take 4 (standard
/// deviation), of other features 55 to 60, give or take 6.
constexpr int kMaxBitsOfHalf = 44;

using DescriptorHalf = std::array<uint8_t, sizeof(OrbDescriptor) / 2>;

/// What is compared of trained features: close together, for the processor's caches.
class TrainedDescriptors {
 public:
  static constexpr size_t kBlock = 64;  ///< first halves come in blocks, the last one filled up
  explicit TrainedDescriptors(std::span<const TrainedFeature> trained);
  size_t size() const { return points_.size(); }
  const OrbDescriptor& descriptor(size_t i) const { return descriptors_[i]; }
  const DescriptorHalf* first_halves(size_t i) const { return &halves_[i]; }
  const Eigen::Vector3f& point(size_t i) const { return points_[i]; }

 private:
  std::vector<OrbDescriptor> descriptors_;
  std::vector<DescriptorHalf> halves_;
  std::vector<Eigen::Vector3f> points_;
};

/// The trained feature that is nearest to a seen one by Hamming distance.
struct NearestTrained {
  static constexpr size_t kNone = std::numeric_limits<size_t>::max();
  size_t index = kNone;
  int bits = 257;   ///< that differ
  int other = 257;  ///< of the nearest one at another place of the object
};

/// `elsewhere` [m]: what counts as another place. One for every descriptor. The processor's own
/// instruction is used where it has one; the numbers are the same.
void match_features(std::span<const OrbFeature> seen, const TrainedDescriptors& trained,
                    float elsewhere, std::span<NearestTrained> out);
void match_features_scalar(std::span<const OrbFeature> seen, const TrainedDescriptors& trained,
                           float elsewhere, std::span<NearestTrained> out);
void match_features_popcnt(std::span<const OrbFeature> seen, const TrainedDescriptors& trained,
                           float elsewhere, std::span<NearestTrained> out);

}  // namespace sightline::observe
