// SPDX-License-Identifier: Apache-2.0
#include "observe/scene/background_kernel_body.hpp"

namespace sightline::observe {

void learn_usual_avx2(const BackgroundRow& row, uint8_t* usual) { learn_row(row, usual); }

}  // namespace sightline::observe
