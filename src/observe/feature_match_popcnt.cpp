// SPDX-License-Identifier: Apache-2.0
#include "feature_match_body.hpp"

namespace sightline::observe {

void match_features_popcnt(std::span<const OrbFeature> seen, std::span<const TaughtFeature> taught,
                           float elsewhere, std::span<NearestTaught> out) {
  for (size_t i = 0; i < seen.size(); ++i) out[i] = nearest_to(seen[i], taught, elsewhere);
}

}  // namespace sightline::observe
