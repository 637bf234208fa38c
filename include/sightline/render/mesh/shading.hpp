// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace sightline {

/// How the light falls: on faces, or on a surface that is round between the mesh's creases.
enum class Shading : uint8_t { kFlat, kSmooth };

}  // namespace sightline
