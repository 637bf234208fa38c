// SPDX-License-Identifier: Apache-2.0
#define SIGHTLINE_TILE_KERNELS kAvx2Kernels
#include "render/overlay/tile/tile_kernels_body.hpp"
