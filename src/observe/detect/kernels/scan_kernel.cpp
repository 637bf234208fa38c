// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "observe/detect/kernels/scan_kernel_body.hpp"
#include "sightline/base/cpu.hpp"

namespace sightline::observe {

bool sum_features_scalar(std::span<const uint8_t* const> features, ptrdiff_t offset, int columns,
                         uint8_t threshold, uint8_t* sums) {
  return sum_all(features, offset, columns, threshold, sums);
}

bool sum_features(std::span<const uint8_t* const> features, ptrdiff_t offset, int columns,
                  uint8_t threshold, uint8_t* sums) {
#ifdef SIGHTLINE_X86_64
  static const auto best = cpu_has_avx2() ? sum_features_avx2 : sum_features_scalar;
  return best(features, offset, columns, threshold, sums);
#else
  return sum_features_scalar(features, offset, columns, threshold, sums);
#endif
}

size_t next_reaching(std::span<const uint8_t> sums, size_t begin, size_t end, uint8_t threshold) {
  for (; begin < end; begin += kBytes) {
    const auto block = vectors::load<Bytes>(sums.data() + begin);
    if (!vectors::any((Bytes)(block >= threshold))) continue;
    const size_t last = std::min(end, begin + kBytes);
    for (size_t i = begin; i < last; ++i) {
      if (sums[i] >= threshold) return i;
    }
  }
  return end;
}

}  // namespace sightline::observe
