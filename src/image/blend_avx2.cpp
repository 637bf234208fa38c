// SPDX-License-Identifier: Apache-2.0
#include "image/blend_kernels_body.hpp"

namespace sightline::image::blend {

void plane_row_avx2(uint8_t* frame, const uint8_t* color, const uint8_t* alpha, int n) {
  plane_row(frame, color, alpha, n);
}

void pair_row_avx2(uint8_t* frame_uv, const uint8_t* u, const uint8_t* v, const uint8_t* alpha,
                   int n) {
  pair_row(frame_uv, u, v, alpha, n);
}

}  // namespace sightline::image::blend
