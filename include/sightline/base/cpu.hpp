// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace sightline {

/// True if this processor has AVX2 and FMA and SIGHTLINE_NO_AVX2 is not set in the environment.
/// Kernels choose once, at the first call.
bool cpu_has_avx2();

}  // namespace sightline
