// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/pixels/half_size_frame.hpp"
#include "observe/detect/pixels/outline_sides.hpp"

namespace sightline::observe {

/// A joint histogram of luma and both color differences.
class ColorHistogram {
 public:
  static constexpr size_t kBins = static_cast<size_t>(kColorBins) * kColorBins * kColorBins;

  static size_t bin(const HalfSizeImage& image, int x, int y) {
    const auto chroma = [&](size_t plane) {  // most colors are dull
      return std::clamp((image.row(plane, y)[x] - 128) / 12 + kColorBins / 2, 0, kColorBins - 1);
    };
    const int luma = image.row(0, y)[x] / (256 / kColorBins);
    return static_cast<size_t>((luma * kColorBins + chroma(1)) * kColorBins + chroma(2));
  }

  /// Places out of the image do not count.
  void add(const HalfSizeImage& image, const Eigen::Vector2d& place) {
    const auto at = pixel_of(place, image.width, image.height);
    if (!at) return;
    counts_[bin(image, at->x, at->y)] += 1;
    total_ += 1;
  }
  double share(size_t bin) const { return total_ > 0 ? counts_[bin] / total_ : 0; }
  /// 1 less the Bhattacharyya coefficient; 0 if either is empty.
  double difference(const ColorHistogram& other) const {
    if (!(total_ > 0) || !(other.total_ > 0)) return 0;
    double common = 0;
    for (size_t i = 0; i < counts_.size(); ++i) common += std::sqrt(counts_[i] * other.counts_[i]);
    return 1 - common / std::sqrt(total_ * other.total_);
  }

 private:
  std::array<double, kBins> counts_{};
  double total_ = 0;
};

}  // namespace sightline::observe
