// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>

#include "sightline/base/time.hpp"
#include "sightline/geometry/box3.hpp"

namespace sightline {

struct DetectorOptions {
  /// Distances from a camera at which the object is looked for [m]; 0: from where the cameras look
  /// and how large the object is in their images.
  double nearest = 0, farthest = 0;
  /// Where the middle of the object can be, world frame; nothing is looked for elsewhere. Distances
  /// follow from it where none are given.
  std::optional<Box3> volume;
  /// Least evidence of a pose that is accepted.
  double accept = 0.4;
  /// Poses within this share of the best one's evidence are as possible as that.
  double margin = 0.82;

  /// Sizes that are looked for in the image that is searched (about 640x480), where no distances
  /// are given: diameter [px] by its edges and by its silhouette, and share of the image's height.
  double min_diameter_px = 45, min_silhouette_px = 20, max_height_share = 0.8;
  /// Frames that are older than the newest one by more than this do not take part.
  Duration max_age = std::chrono::milliseconds(100);
  /// Speed of the object that responses allow for between exposures of two cameras [m/s].
  double usual_speed = 0.4;

  size_t scan_hits = 12000;   ///< templates of one camera that are tried in the others
  double sigma_px = 2.5;      ///< of one fitted line, of the image that is searched
  double independent = 0.06;  ///< share of the lines that is worth an independent measurement

  bool operator==(const DetectorOptions&) const = default;
};

}  // namespace sightline
