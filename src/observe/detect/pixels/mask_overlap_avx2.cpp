// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/pixels/mask_overlap_body.hpp"

namespace sightline::observe {

void overlap_masks_avx2(std::span<const MaskPatch::Bits> masks, const MaskPatch& patch,
                        MaskOverlap* out) {
  overlap_all(masks, patch, out);
}

}  // namespace sightline::observe
