// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "sightline/observe/terms/foreground_map.hpp"

namespace sightline::observe {

/// 1 at pixels that are not background, and at those around them.
void dilate_foreground(const ForegroundMap& map, std::vector<uint8_t>& mask);

/// A mask in twice as many pixels in each direction, as many as an image of this size has.
void magnify(const std::vector<uint8_t>& from, int from_width, int from_height, int width,
             int height, std::vector<uint8_t>& to);
/// The map in twice as many pixels in each direction, as many as an image of this size has.
void magnify(const ForegroundMap& from, int width, int height, ForegroundMap& to);

/// A mask in half as many pixels in each direction: 1 where any of the four is.
void reduce(const std::vector<uint8_t>& from, int from_width, int from_height,
            std::vector<uint8_t>& to);
/// The map in half as many pixels in each direction: one of the four.
void reduce(const ForegroundMap& from, ForegroundMap& to);

/// `width` x `height` pixels of the map, each the middle one of so many in each direction.
void shrink(const ForegroundMap& from, int shrink, int width, int height, ForegroundMap& to);

}  // namespace sightline::observe
