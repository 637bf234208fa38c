// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/image/planes.hpp"

namespace sightline::observe {

/// Whether an image shows more than grays of one tint, by its color differences (of any size): a
/// gray camera, or one whose light is infrared, does not.
bool has_colors(const PlaneView& u, const PlaneView& v);

}  // namespace sightline::observe
