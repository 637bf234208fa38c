// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/pixels/mask_overlap_body.hpp"
#include "sightline/base/cpu.hpp"

namespace sightline::observe {

void overlap_masks_scalar(std::span<const MaskPatch::Bits> masks, const MaskPatch& patch,
                          MaskOverlap* out) {
  overlap_all(masks, patch, out);
}

void overlap_masks(std::span<const MaskPatch::Bits> masks, const MaskPatch& patch,
                   MaskOverlap* out) {
#ifdef SIGHTLINE_X86_64
  static const auto best = cpu_has_avx2() ? overlap_masks_avx2 : overlap_masks_scalar;
  best(masks, patch, out);
#else
  overlap_masks_scalar(masks, patch, out);
#endif
}

}  // namespace sightline::observe
