// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/kernels/gradient_kernel_body.hpp"
#include "sightline/base/cpu.hpp"

namespace sightline::observe {

void find_gradients_scalar(const std::array<GradientRows, 3>& planes, int left, int right,
                           const GradientRow& out) {
  find_in_row(planes, left, right, out);
}

void find_gradients(const std::array<GradientRows, 3>& planes, int left, int right,
                    const GradientRow& out) {
#ifdef SIGHTLINE_X86_64
  static const auto best = cpu_has_avx2() ? find_gradients_avx2 : find_gradients_scalar;
  best(planes, left, right, out);
#else
  find_gradients_scalar(planes, left, right, out);
#endif
}

}  // namespace sightline::observe
