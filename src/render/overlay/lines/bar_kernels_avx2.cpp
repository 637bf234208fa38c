// SPDX-License-Identifier: Apache-2.0
#define SIGHTLINE_BAR_LANES 8
#define SIGHTLINE_BAR_DRAW draw_avx2
#include "render/overlay/lines/bar_kernels_body.hpp"
