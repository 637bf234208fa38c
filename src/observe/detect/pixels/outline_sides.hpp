// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>

#include "observe/detect/pixels/sample_edges.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline::observe {

struct PixelPlace {
  int x = 0, y = 0;
};

/// The pixel that a place is in; empty out of the image.
inline std::optional<PixelPlace> pixel_of(const Eigen::Vector2d& place, int width, int height) {
  const int x = static_cast<int>(std::floor(place.x() + 0.5));
  const int y = static_cast<int>(std::floor(place.y() + 0.5));
  if (x < 0 || y < 0 || x >= width || y >= height) return std::nullopt;
  return PixelPlace{x, y};
}

/// Visits the places [half-size px] on both sides of a stretch of an outline: 2 to 1 + `reach`
/// pixels from it, as far as the object reaches inward, and outward to what stands out there.
/// The stretch: every `sample_step`-th sample of [begin, end) of the view's contour.
template <typename Inside, typename Outside>
void visit_sides(const View& view, size_t begin, size_t end, size_t sample_step,
                 const CameraModel& camera, const Rigid3& camera_from_object, int reach,
                 const Inside& inside, const Outside& outside) {
  const Eigen::Isometry3d isometry(camera_from_object.matrix());
  for (size_t i = begin; i < end; i += sample_step) {
    const ContourSample& contour = view.contour[i];
    const Eigen::Vector3d point = contour.point.cast<double>();
    const auto sample = project_sample(camera, isometry, point, contour.normal.cast<double>());
    if (!sample) continue;
    const double px_per_meter = camera.parameters().fx / 2 / (isometry * point).z();
    for (int s = 2; s < 2 + reach; ++s) {
      if (s < px_per_meter * static_cast<double>(contour.foreground)) {
        inside(sample->pixel - s * sample->normal);
      }
      if (s < px_per_meter * static_cast<double>(contour.background)) {
        outside(sample->pixel + s * sample->normal);
      }
    }
  }
}

}  // namespace sightline::observe
