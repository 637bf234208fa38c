// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "observe/scene/background_cells.hpp"
#include "sightline/image/planes.hpp"
#include "sightline/observe/scene/background_model.hpp"

namespace sightline::observe {

/// Compares an image with its background. A pixel counts with its eight or 24 neighbors: the mean
/// of their squared differences in sigmas is compared with what noise gives, so that a small
/// difference of color over an area is seen. What is darker by a factor that luma and color share
/// may be a shadow (Prati et al., Detecting Moving Shadows, PAMI 2003).
class ChangeMap {
 public:
  /// `image`: luma and chroma at half size, as large as the background; `unknown`, by pixel: not 0
  /// where nothing is known; `light`: by which the image is brighter above black.
  void compute(const std::array<PlaneView, 3>& image, const BackgroundCells& usual,
               const std::vector<uint8_t>& unknown, float light, ForegroundMap& out);

 private:
  void compare_row(const std::array<PlaneView, 3>& image, const BackgroundCells& usual, float light,
                   int y, float* squares) const;
  uint8_t classify(const std::array<PlaneView, 3>& image, const BackgroundCells& usual, float light,
                   int x, int y) const;
  void clean(ForegroundMap& out);

  std::vector<float> squares_, columns_, far_columns_;
  std::vector<uint8_t> raw_, columns_in_three_;
};

}  // namespace sightline::observe
