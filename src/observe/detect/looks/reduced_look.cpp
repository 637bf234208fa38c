// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/looks/reduced_look.hpp"

#include "observe/detect/pixels/foreground_masks.hpp"

namespace sightline::observe {

void ReducedLook::make(HalfSizeImage& image, EdgeImage& edges) const {
  reduce(*half_.image, image);
  edges.compute(image);
  if (half_.foreground != nullptr) reduce(*half_.foreground, foreground_);
  if (half_mask_ == nullptr) return;
  reduce(*half_mask_, half_.image->width, half_.image->height, mask_);
  edges.keep_where(mask_);
}

}  // namespace sightline::observe
