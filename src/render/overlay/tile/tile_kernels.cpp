// SPDX-License-Identifier: Apache-2.0
#define SIGHTLINE_TILE_KERNELS kBaseKernels
#include "render/overlay/tile/tile_kernels_body.hpp"

#include "sightline/base/cpu.hpp"

namespace sightline::tile {

const Kernels& kernels() {
#ifdef SIGHTLINE_X86_64
  if (cpu_has_avx2()) return kAvx2Kernels;
#endif
  return kBaseKernels;
}

}  // namespace sightline::tile
