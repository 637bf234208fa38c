// SPDX-License-Identifier: Apache-2.0
#include "feature_match.hpp"

#include "feature_match_body.hpp"
#include "sightline/base/cpu.hpp"

namespace sightline::observe {

void match_features_scalar(std::span<const OrbFeature> seen, std::span<const TaughtFeature> taught,
                           float elsewhere, std::span<NearestTaught> out) {
  for (size_t i = 0; i < seen.size(); ++i) out[i] = nearest_to(seen[i], taught, elsewhere);
}

void match_features(std::span<const OrbFeature> seen, std::span<const TaughtFeature> taught,
                    float elsewhere, std::span<NearestTaught> out) {
#ifdef SIGHTLINE_X86_64
  // What has AVX2 has it too.
  static const auto kBest = cpu_has_avx2() ? match_features_popcnt : match_features_scalar;
  kBest(seen, taught, elsewhere, out);
#else
  match_features_scalar(seen, taught, elsewhere, out);
#endif
}

}  // namespace sightline::observe
