// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/image/planes.hpp"

namespace sightline::observe {

/// By how much a camera's images (limited range) are darker than cameras expose. Limits of
/// gradients and bins of colors are so many levels of an image that is exposed well.
class ExposureGain {
 public:
  /// 1 where one pixel in twenty is as bright as 130, else what takes that pixel to 205, 4 at most,
  /// in steps of 1/32. Changes only where the light does, by a quarter, so that what is compared
  /// from image to image stays comparable; what was dark is so up to 160.
  double update(const PlaneView& luma);

 private:
  double gain_ = 1;
  bool known_ = false;
};

/// What a longer exposure would have shown, in place or beside it (same sizes): luma above black
/// and color differences times `gain`; what becomes brighter than a level can be is lost.
void expose_luma(double gain, const PlaneView& from, const MutablePlaneView& to);
void expose_color(double gain, const PlaneView& from, const MutablePlaneView& to);

}  // namespace sightline::observe
