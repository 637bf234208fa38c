// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/check_options.hpp"

namespace sightline::observe {

Status check(const DetectorOptions& o, size_t cameras) {
  const auto refuse = [](const char* what) {
    return make_error(ErrorCode::kInvalidInput, "detector", "{}", what);
  };
  if (cameras == 0) return refuse("no camera to look through");
  if (!(o.nearest >= 0) || !(o.farthest >= 0) || (o.farthest > 0 && o.farthest <= o.nearest)) {
    return refuse("nearest and farthest must be distances in meters, nearest first");
  }
  if (!(o.accept > 0) || !(o.margin > 0 && o.margin <= 1)) {
    return refuse("accept must be positive, margin above 0 and at most 1");
  }
  if (!(o.min_diameter_px > 0) || !(o.min_silhouette_px > 0) || !(o.max_height_share > 0) ||
      o.max_age < Duration(0) || !(o.usual_speed >= 0)) {
    return refuse("sizes must be positive, max_age and usual_speed not negative");
  }
  if (o.scan_hits < 10 || !(o.sigma_px > 0) || !(o.independent > 0 && o.independent <= 1)) {
    return refuse("scan_hits, sigma_px and independent must be positive");
  }
  return {};
}

}  // namespace sightline::observe
