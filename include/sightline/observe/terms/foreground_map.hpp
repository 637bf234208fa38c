// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline {

/// What differs from the learned background in an image, at half size.
struct ForegroundMap {
  enum Class : uint8_t {
    kBackground = 0,
    kShadow = 1,      ///< darker, but of the same color: a shadow or a thing in the room's color
    kForeground = 2,  ///< something else is in front
    kUnknown = 3,     ///< not learned yet, or another known object is there
  };
  int width = 0, height = 0;
  std::vector<uint8_t> classes;  ///< of every pixel, row by row
  double share = 0;              ///< of the known pixels that are shadow or foreground

  const uint8_t* row(int y) const {
    return classes.data() + static_cast<size_t>(y) * static_cast<size_t>(width);
  }
};

}  // namespace sightline
