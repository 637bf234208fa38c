// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/pixels/sector_contrast.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/pixels/outline_sides.hpp"

namespace sightline::observe {
namespace {

// Colors of one side of a stretch, each channel by itself.
class SideColors {
 public:
  void add(const HalfSizeImage& image, const Eigen::Vector2d& place) {
    const auto at = pixel_of(place, image.width, image.height);
    if (!at) return;
    for (size_t plane = 0; plane < 3; ++plane) {
      // Most colors are dull: half the range of chroma is as good as all of it.
      const int value = image.row(plane, at->y)[at->x];
      const int level = plane == 0 ? value : std::clamp(2 * (value - 128) + 128, 0, 255);
      ++counts_[plane][static_cast<size_t>(level) * kSectorBins / 256];
    }
    ++total_;
  }
  int total() const { return total_; }

  // A gray image has one channel of three, and would never reach what is asked of colored ones.
  double difference(const SideColors& other, bool in_color) const {
    double common = 1;
    for (size_t plane = 0; plane < 3; ++plane) {
      double sum = 0;
      for (size_t bin = 0; bin < kSectorBins; ++bin) {
        sum += std::sqrt(static_cast<double>(counts_[plane][bin] * other.counts_[plane][bin]));
      }
      common *= sum / std::sqrt(static_cast<double>(total_) * static_cast<double>(other.total_));
    }
    return 1 - (in_color ? common : std::pow(common, kGrayExponent));
  }

 private:
  std::array<std::array<int, kSectorBins>, 3> counts_{};
  int total_ = 0;
};

}  // namespace

double sector_contrast(const View& view, const CameraModel& camera,
                       const Rigid3& camera_from_object, const HalfSizeImage& image,
                       size_t sample_step) {
  double sum = 0;
  for (size_t sector = 0; sector < kSectors; ++sector) {
    SideColors inside, outside;
    const size_t begin = sector * view.contour.size() / kSectors;
    const size_t end = (sector + 1) * view.contour.size() / kSectors;
    visit_sides(
        view, begin, end, sample_step, camera, camera_from_object, kSectorReach,
        [&](const Eigen::Vector2d& place) { inside.add(image, place); },
        [&](const Eigen::Vector2d& place) { outside.add(image, place); });
    if (inside.total() < kMinSectorPixels || outside.total() < kMinSectorPixels) continue;
    sum += inside.difference(outside, image.in_color);
  }
  return sum / static_cast<double>(kSectors);
}

}  // namespace sightline::observe
