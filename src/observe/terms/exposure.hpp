// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/image/planes.hpp"

namespace sightline::observe {

/// By how much an image (limited range) is darker than cameras expose: 1 where one pixel in twenty
/// is as bright as 130, else what takes that pixel to 205, 4 at most, in steps of 1/32. What was
/// dark a moment ago is so until that pixel is as bright as 160. Limits of gradients and bins of
/// colors are so many levels of an image that is exposed well.
double exposure_gain(const PlaneView& luma, bool was_dark = false);

/// What a longer exposure would have shown, in place or beside it (same sizes): luma above black
/// and color differences times `gain`; what becomes brighter than a level can be is lost.
void expose_luma(double gain, const PlaneView& from, const MutablePlaneView& to);
void expose_color(double gain, const PlaneView& from, const MutablePlaneView& to);

}  // namespace sightline::observe
