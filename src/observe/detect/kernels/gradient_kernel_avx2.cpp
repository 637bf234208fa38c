// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/kernels/gradient_kernel_body.hpp"

namespace sightline::observe {

void find_gradients_avx2(const std::array<GradientRows, 3>& planes, int left, int right,
                         const GradientRow& out) {
  find_in_row(planes, left, right, out);
}

}  // namespace sightline::observe
