// SPDX-License-Identifier: Apache-2.0
#ifdef __AVX2__
#include "render/raster/raster_lanes.inl"

namespace sightline::raster {

const Kernels* avx2_kernels() { return &kKernels; }

}  // namespace sightline::raster

#else
#include "render/raster/raster_kernels.hpp"

namespace sightline::raster {

const Kernels* avx2_kernels() { return nullptr; }

}  // namespace sightline::raster

#endif
