// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sightline/observe/scene/background_model.hpp"

namespace sightline::observe {

/// Marks (1) the pixels of a half-size image that known objects cover, with an eighth of their
/// radius and two pixels around them. `out` has the image's size and is cleared first.
void mark_known_places(const CalibratedCamera& camera, std::span<const KnownObject> known,
                       int width, int height, std::vector<uint8_t>& out);

}  // namespace sightline::observe
