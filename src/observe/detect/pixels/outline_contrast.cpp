// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/pixels/outline_contrast.hpp"

#include <Eigen/Core>
#include <algorithm>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/pixels/color_histogram.hpp"
#include "observe/detect/pixels/outline_sides.hpp"

namespace sightline::observe {
namespace {

// Share of the known pixels that are foreground; shadow counts half.
class ForegroundShare {
 public:
  void add(const ForegroundMap& map, const Eigen::Vector2d& place) {
    const auto at = pixel_of(place, map.width, map.height);
    if (!at) return;
    const uint8_t what = map.row(at->y)[at->x];
    if (what == ForegroundMap::kUnknown) return;
    sum_ += 0.5 * what;
    ++count_;
  }
  double share() const { return count_ > 0 ? sum_ / count_ : 0; }

 private:
  double sum_ = 0;
  int count_ = 0;
};

}  // namespace

double outline_contrast(const View& view, const CameraModel& camera,
                        const Rigid3& camera_from_object, const HalfSizeImage& image,
                        const ForegroundMap* foreground) {
  ColorHistogram inside, outside;
  ForegroundShare foreground_inside, foreground_outside;
  const auto add = [&](const Eigen::Vector2d& place, ColorHistogram& colors,
                       ForegroundShare& share) {
    colors.add(image, place);
    if (foreground != nullptr) share.add(*foreground, place);
  };
  visit_sides(
      view, 0, view.contour.size(), kSampleStep, camera, camera_from_object, kContrastSteps,
      [&](const Eigen::Vector2d& place) { add(place, inside, foreground_inside); },
      [&](const Eigen::Vector2d& place) { add(place, outside, foreground_outside); });
  return std::max(inside.difference(outside),
                  foreground_inside.share() - foreground_outside.share());
}

}  // namespace sightline::observe
