// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sightline/image/planes.hpp"
#include "sightline/observe/background_model.hpp"

namespace sightline {

/// Level of black and of no colour.
constexpr int kBlack = 16, kGrey = 128;

/// What a picture usually looks like, as the background model keeps it: 1/64 levels, row by row.
struct UsualPicture {
  int width = 0, height = 0;
  std::array<const int16_t*, 3> mean;    ///< luma and both colours
  std::array<const int16_t*, 2> spread;  ///< one sigma of luma and of colour
  std::array<int, 2> least_spread;
  const uint8_t* unknown;  ///< not 0: nothing is known of the pixel
};

/// Tells what is new in a picture. A pixel counts with its eight or 24 neighbours: the mean of
/// their squared differences in sigmas is compared with what noise gives, so that a small
/// difference of colour over an area is seen. What is darker by a factor that luma and colour share
/// may be a shadow (Prati et al., Detecting Moving Shadows, PAMI 2003).
class ChangeMap {
 public:
  /// `picture`: luma and colours at half size; `light`: by which it is brighter above black.
  void compute(const std::array<PlaneView, 3>& picture, const UsualPicture& usual, float light,
               ForegroundMap& out);

 private:
  void compare_row(const std::array<PlaneView, 3>& picture, const UsualPicture& usual, float light,
                   int y, float* squares) const;
  void clean(ForegroundMap& out);

  std::vector<float> squares_, columns_, far_columns_;
  std::vector<uint8_t> raw_, columns_in_three_;
};

}  // namespace sightline
