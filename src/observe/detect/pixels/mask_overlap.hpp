// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline::observe {

/// A piece of a foreground map in the grid of the silhouette masks, one bit a cell.
struct MaskPatch {
  using Bits = std::array<uint64_t, ViewpointModel::kMaskSize / 2>;  ///< two rows a word
  Bits front{}, shadow{}, unknown{};
};

/// Cells that a silhouette shares with a patch.
struct MaskOverlap {
  uint16_t front = 0, shadow = 0, unknown = 0;
};

/// One overlap for every mask.
void overlap_masks(std::span<const MaskPatch::Bits> masks, const MaskPatch& patch,
                   MaskOverlap* out);
void overlap_masks_scalar(std::span<const MaskPatch::Bits> masks, const MaskPatch& patch,
                          MaskOverlap* out);
void overlap_masks_avx2(std::span<const MaskPatch::Bits> masks, const MaskPatch& patch,
                        MaskOverlap* out);

}  // namespace sightline::observe
