// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "observe/detect/pixels/edge_maps.hpp"
#include "observe/detect/pixels/half_size_frame.hpp"

namespace sightline::observe {

/// Which edges of an image lie between two regions, and not within one: letters, joints of tiles
/// and fine texture have the same colors on both sides, a few pixels away. Compared are boxes of 5
/// x 5 pixels, four pixels to either side along the gradient, as normal distributions, by the
/// Bhattacharyya coefficient of each channel.
class RegionBorders {
 public:
  /// `image` must be the one of the edges; the two stay as they are. Nothing is allocated for
  /// images of the same size.
  void compute(const HalfSizeImage& image, const EdgeImage& edges);

  /// 0: no such edge here; else EdgeImage::bins().
  const std::vector<uint8_t>& bins() const { return bins_; }

 private:
  struct Sums {
    std::vector<int32_t> values, squares;
  };
  struct Normal {
    float mean, variance;
  };
  void sum_up(const HalfSizeImage& image);
  Normal box(size_t plane, int x, int y) const;
  bool differ(int x, int y, int other_x, int other_y) const;

  int width_ = 0, height_ = 0;
  std::array<Sums, 3> sums_;  ///< of everything above and to the left, by plane
  std::vector<uint8_t> bins_;
};

}  // namespace sightline::observe
