// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/observe/detect/detector_options.hpp"
#include "sightline/observe/terms/detection.hpp"

namespace sightline::observe {

/// A camera with 1 / `shrink` times as many pixels in each direction, an even number of them: each
/// is the mean of a square of the image's. Empty where that is less than a CameraModel can have.
std::optional<CalibratedCamera> shrunk(CalibratedCamera camera, int shrink);

/// Size of a camera's frames, and how many of their pixels in each direction are one of the images
/// that are searched.
struct SearchSize {
  int width = 0, height = 0;
  int shrink = 1;

  /// Where a point of the frame is in the image that is searched.
  Eigen::Vector2d searched(const Eigen::Vector2d& pixel) const {
    const Eigen::Vector2d half = Eigen::Vector2d::Constant(0.5);  // (0, 0) is the middle of a pixel
    return (pixel + half) / shrink - half;
  }
};

/// Cameras become those whose images are searched for an object of this radius [m]: of about
/// kSearchedPixels, where so many are left that the object is kSearchedDiameterPx large in the
/// middle of the distances at which it is looked for. More pixels cost more and tell less: steps of
/// the search, blur, errors of mesh and lens are more of them. Returns what `cameras` were.
std::vector<SearchSize> shrink_to_search(std::span<DetectorCamera> cameras, double object_radius,
                                         const DetectorOptions& options);

}  // namespace sightline::observe
