// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace sightline::bars {

/// A straight bar to draw into one or two planes of one geometry: its coverage is the product of
/// the box-filtered distances across and along. Plain data: see raster_kernels.hpp.
struct Bar {
  uint8_t* plane[2];
  ptrdiff_t stride[2];
  int value[2];
  int planes;  ///< 1 or 2
  int width, height;
  int step;  ///< bytes from sample to sample
  float along_x, along_y;
  float middle_x, middle_y;
  float reach_across, reach_along;  ///< half its size and half a pixel
  float max;                        ///< coverage in its middle
  float opacity;
};

/// Both give the same bits.
void draw_scalar(const Bar& bar);
#ifdef SIGHTLINE_X86_64
void draw_avx2(const Bar& bar);
#endif

}  // namespace sightline::bars
