// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>

#include "sightline/model/frame.hpp"

namespace sightline {

/// What a frame holds in memory while it waits to be written, about.
inline size_t bytes_of(const Frame& frame) {
  const auto pixels =
      static_cast<size_t>(frame.info().width) * static_cast<size_t>(frame.info().height);
  return std::max(frame.payload().bytes.size(), pixels * 3 / 2);
}

}  // namespace sightline
