// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/kernels/scan_kernel_body.hpp"

namespace sightline::observe {

bool sum_features_avx2(std::span<const uint8_t* const> features, ptrdiff_t offset, int columns,
                       uint8_t threshold, uint8_t* sums) {
  return sum_all(features, offset, columns, threshold, sums);
}

}  // namespace sightline::observe
