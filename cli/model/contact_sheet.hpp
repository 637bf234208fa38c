// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "sightline/image/image.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline::cli {

/// Forty views spread over the sphere, for a person's eye: depth in gray, outline samples yellow
/// with a stroke along the normal, creases green, edges where the surface hides itself blue.
Result<std::shared_ptr<const Image>> draw_contact_sheet(const ViewpointModel& model,
                                                        const DepthRendererFactory& factory);

}  // namespace sightline::cli
