// SPDX-License-Identifier: Apache-2.0
// The tile kernels as plain loops, compiled without vectorization: what their vectors must equal.
#define SIGHTLINE_TILE_PLAIN
#define SIGHTLINE_TILE_KERNELS kPlainKernels
#include "render/overlay/tile/tile_kernels.hpp"

namespace sightline::tile {
extern const Kernels kPlainKernels;
}

#include "render/overlay/tile/tile_kernels_body.hpp"
