// SPDX-License-Identifier: Apache-2.0
#define SIGHTLINE_BAR_LANES 4
#define SIGHTLINE_BAR_DRAW draw_scalar
#include "render/overlay/lines/bar_kernels_body.hpp"
