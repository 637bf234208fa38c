// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "render/overlay/frame_target.hpp"
#include "render/overlay/subject.hpp"
#include "render/overlay/text/label_placement.hpp"
#include "render/overlay/tile/tile_compositor.hpp"

namespace sightline::render {

Extent extent_of(const marks::Circle& circle);

/// The circle and the upright box of the whole object, where its style says so; returns the extent
/// of what there is, drawn or not.
Extent draw_bounding_marks(const FrameTarget& target, const Subject& subject,
                           const TileCoverage& coverage,
                           const std::optional<marks::Circle>& circle);

}  // namespace sightline::render
