// SPDX-License-Identifier: Apache-2.0
#define SIGHTLINE_TILE_KERNELS kScalarKernels
#include "tile_kernels_body.hpp"
