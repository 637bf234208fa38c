// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/pixels/color_foreground.hpp"

#include <algorithm>
#include <array>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/pixels/color_histogram.hpp"
#include "observe/detect/pixels/outline_sides.hpp"

namespace sightline::observe {

ForegroundMap color_foreground(const View& view, const CameraModel& camera,
                               const Rigid3& camera_from_object, const HalfSizeImage& image,
                               const Eigen::Vector2d& center, double radius_px) {
  ColorHistogram inside, outside;
  const int reach = std::clamp(static_cast<int>(0.6 * radius_px), kSectorReach, 60);
  visit_sides(
      view, 0, view.contour.size(), kSampleStep, camera, camera_from_object, reach,
      [&](const Eigen::Vector2d& place) { inside.add(image, place); },
      [&](const Eigen::Vector2d& place) { outside.add(image, place); });
  std::array<double, ColorHistogram::kBins> posterior{};
  for (size_t bin = 0; bin < posterior.size(); ++bin) {
    const double in = inside.share(bin), out = outside.share(bin);
    posterior[bin] = in + out > 0 ? in / (in + out) : 0.5;
  }
  ForegroundMap map;
  map.width = image.width;
  map.height = image.height;
  map.classes.assign(static_cast<size_t>(image.width) * static_cast<size_t>(image.height),
                     ForegroundMap::kUnknown);
  const double around = 1.5 * radius_px;
  const int left = std::max(0, static_cast<int>(center.x() - around)),
            right = std::min(image.width, static_cast<int>(center.x() + around) + 1),
            top = std::max(0, static_cast<int>(center.y() - around)),
            bottom = std::min(image.height, static_cast<int>(center.y() + around) + 1);
  for (int y = top; y < bottom; ++y) {
    uint8_t* row = map.classes.data() + static_cast<size_t>(y) * static_cast<size_t>(map.width);
    for (int x = left; x < right; ++x) {
      const double p = posterior[ColorHistogram::bin(image, x, y)];
      if (p > kForegroundPosterior) row[x] = ForegroundMap::kForeground;
      if (p < 1 - kForegroundPosterior) row[x] = ForegroundMap::kBackground;
    }
  }
  return map;
}

}  // namespace sightline::observe
