// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "observe/detect/pixels/mask_overlap.hpp"
#include "sightline/base/vectors.hpp"

namespace sightline::observe {
namespace {

// Compiled with and without the processor's instruction for counting bits; arm64 counts in vectors.
inline void overlap_all(std::span<const MaskPatch::Bits> masks, const MaskPatch& patch,
                        MaskOverlap* out) {
  const auto shared = [](const MaskPatch::Bits& mask, const MaskPatch::Bits& piece) {
    return static_cast<uint16_t>(vectors::bits_set<std::tuple_size_v<MaskPatch::Bits>>(
        &mask, &piece, [](auto a, auto b) { return a & b; }));
  };
  for (size_t i = 0; i < masks.size(); ++i) {
    out[i] = {shared(masks[i], patch.front), shared(masks[i], patch.shadow),
              shared(masks[i], patch.unknown)};
  }
}

}  // namespace
}  // namespace sightline::observe
