// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "sightline/observe/detect/detector_options.hpp"
#include "sightline/observe/terms/detection.hpp"

namespace sightline::observe {

/// How large the object may be in the images of one camera.
struct CameraDistances {
  std::vector<float> scales;         ///< that are scanned, nearest first [px of the maps per m]
  double nearest = 0, farthest = 0;  ///< at which silhouettes are looked for [m]
  /// Where in the image the middle of the object can be [px]; empty: anywhere.
  Eigen::AlignedBox2d image;
};

/// From the options (distances, or else the volume), or else from where the optical axes of the
/// cameras meet (as far as half and 1.7 times that distance) and from how large the object is in
/// the images.
struct SearchDistances {
  std::vector<CameraDistances> cameras;
  int map_margin = 0;  ///< that templates need around response maps [px of the maps]
};
SearchDistances search_distances(std::span<const DetectorCamera> cameras, double object_radius,
                                 const DetectorOptions& options);

}  // namespace sightline::observe
