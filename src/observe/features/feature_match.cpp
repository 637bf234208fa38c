// SPDX-License-Identifier: Apache-2.0
#include "observe/features/feature_match.hpp"

#include "observe/features/feature_match_body.hpp"
#include "sightline/base/cpu.hpp"

namespace sightline::observe {

TrainedDescriptors::TrainedDescriptors(std::span<const TrainedFeature> trained) {
  for (const TrainedFeature& feature : trained) {
    descriptors_.push_back(feature.descriptor);
    std::copy_n(feature.descriptor.begin(), sizeof(DescriptorHalf), halves_.emplace_back().begin());
    points_.push_back(feature.point);
  }
  halves_.resize((points_.size() + kBlock - 1) / kBlock * kBlock);
}

void match_features_scalar(std::span<const OrbFeature> seen, const TrainedDescriptors& trained,
                           float elsewhere, std::span<NearestTrained> out) {
  find_nearest(seen, trained, elsewhere, out);
}

void match_features(std::span<const OrbFeature> seen, const TrainedDescriptors& trained,
                    float elsewhere, std::span<NearestTrained> out) {
#ifdef SIGHTLINE_X86_64
  // What has AVX2 has it too.
  static const auto best = cpu_has_avx2() ? match_features_popcnt : match_features_scalar;
  best(seen, trained, elsewhere, out);
#else
  match_features_scalar(seen, trained, elsewhere, out);
#endif
}

}  // namespace sightline::observe
