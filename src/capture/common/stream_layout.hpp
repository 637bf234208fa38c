// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "sightline/image/planes.hpp"

namespace sightline::capture {

/// What a camera's buffers hold.
struct StreamLayout {
  PixelFormat pixels = PixelFormat::kI420;  ///< of the frames' payload
  int width = 0, height = 0;
  ptrdiff_t stride = 0;    ///< bytes from row to row; 0: compressed
  size_t image_bytes = 0;  ///< least size of a whole image; 0: compressed
  double rate_hz = 0;      ///< 0: not known
};

}  // namespace sightline::capture
