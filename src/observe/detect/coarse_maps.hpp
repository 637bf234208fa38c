// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "observe/detect/pixels/edge_maps.hpp"
#include "observe/detect/pixels/half_size_frame.hpp"
#include "observe/detect/pixels/region_borders.hpp"
#include "observe/detect/search_camera.hpp"

namespace sightline::observe {

/// Response maps of one image at half the size of the others, for distances at which the object is
/// large: a quarter of the places, as in an image pyramid. Edges are those of the smaller image.
class CoarseMaps {
 public:
  static constexpr int kShrink = 2;  ///< pixels of the other maps per pixel of these

  /// From now on those of this image; only edges where `mask` (of its size) is 1 count, all if it
  /// is empty. `margin`: around the other maps.
  void show(const HalfSizeImage& image, const std::vector<uint8_t>& mask, int margin);

  /// As SearchCamera::far(); `scale`: of these maps.
  const ResponseMaps& far(double scale, double radius) const { return search_.far(scale, radius); }
  int height() const { return image_.height / 2; }  ///< of the maps

 private:
  HalfSizeImage image_;
  EdgeImage edges_;
  RegionBorders borders_;
  std::vector<uint8_t> mask_;
  SearchCamera search_;
};

/// The same columns of every row (empty: all) in maps of half the size, so many rows.
std::vector<std::array<int, 2>> coarse_rows(const std::vector<std::array<int, 2>>& rows,
                                            int height);

}  // namespace sightline::observe
