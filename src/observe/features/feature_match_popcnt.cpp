// SPDX-License-Identifier: Apache-2.0
#include "observe/features/feature_match_body.hpp"

namespace sightline::observe {

void match_features_popcnt(std::span<const OrbFeature> seen,
                           std::span<const TrainedFeature> trained, float elsewhere,
                           std::span<NearestTrained> out) {
  for (size_t i = 0; i < seen.size(); ++i) out[i] = nearest_to(seen[i], trained, elsewhere);
}

}  // namespace sightline::observe
