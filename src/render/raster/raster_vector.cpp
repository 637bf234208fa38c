// SPDX-License-Identifier: Apache-2.0
#include "render/raster/raster_lanes.inl"

namespace sightline::raster {

const Kernels& vector_kernels() { return kKernels; }

}  // namespace sightline::raster
