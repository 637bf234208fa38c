// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>

#include "observe/detect/pixels/mask_overlap.hpp"

namespace sightline::observe {
namespace {

// Compiled with and without the processor's instruction for counting bits.
inline void overlap_all(std::span<const MaskPatch::Bits> masks, const MaskPatch& patch,
                        MaskOverlap* out) {
  for (size_t i = 0; i < masks.size(); ++i) {
    const MaskPatch::Bits& mask = masks[i];
    int front = 0, shadow = 0, unknown = 0;
    for (size_t k = 0; k < mask.size(); ++k) {
      front += std::popcount(mask[k] & patch.front[k]);
      shadow += std::popcount(mask[k] & patch.shadow[k]);
      unknown += std::popcount(mask[k] & patch.unknown[k]);
    }
    out[i] = {static_cast<uint16_t>(front), static_cast<uint16_t>(shadow),
              static_cast<uint16_t>(unknown)};
  }
}

}  // namespace
}  // namespace sightline::observe
