// SPDX-License-Identifier: Apache-2.0
#include "observe/features/feature_match.hpp"

#include "observe/features/feature_match_body.hpp"
#include "sightline/base/cpu.hpp"

namespace sightline::observe {

void match_features_scalar(std::span<const OrbFeature> seen,
                           std::span<const TrainedFeature> trained, float elsewhere,
                           std::span<NearestTrained> out) {
  for (size_t i = 0; i < seen.size(); ++i) out[i] = nearest_to(seen[i], trained, elsewhere);
}

void match_features(std::span<const OrbFeature> seen, std::span<const TrainedFeature> trained,
                    float elsewhere, std::span<NearestTrained> out) {
#ifdef SIGHTLINE_X86_64
  // What has AVX2 has it too.
  static const auto kBest = cpu_has_avx2() ? match_features_popcnt : match_features_scalar;
  kBest(seen, trained, elsewhere, out);
#else
  match_features_scalar(seen, trained, elsewhere, out);
#endif
}

}  // namespace sightline::observe
