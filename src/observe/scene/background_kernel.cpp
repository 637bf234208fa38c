// SPDX-License-Identifier: Apache-2.0
#include "observe/scene/background_kernel_body.hpp"
#include "sightline/base/cpu.hpp"

namespace sightline::observe {

void learn_usual_scalar(const BackgroundRow& row, uint8_t* usual) { learn_row(row, usual); }

void learn_usual(const BackgroundRow& row, uint8_t* usual) {
#ifdef SIGHTLINE_X86_64
  static const auto best = cpu_has_avx2() ? learn_usual_avx2 : learn_usual_scalar;
  best(row, usual);
#else
  learn_usual_scalar(row, usual);
#endif
}

}  // namespace sightline::observe
