// SPDX-License-Identifier: Apache-2.0
#include "observe/features/feature_match_body.hpp"

namespace sightline::observe {

void match_features_popcnt(std::span<const OrbFeature> seen, const TrainedDescriptors& trained,
                           float elsewhere, std::span<NearestTrained> out) {
  find_nearest(seen, trained, elsewhere, out);
}

}  // namespace sightline::observe
