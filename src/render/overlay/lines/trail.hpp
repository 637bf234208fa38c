// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/overlay/frame_target.hpp"
#include "render/overlay/subject.hpp"

namespace sightline::render {

/// The path of the object's center over the style's `trail_seconds` before `capture`, from its
/// track's history, fading with age.
void draw_trail(const FrameTarget& target, const CameraModel& model,
                const Rigid3& camera_from_world, const Subject& subject, Time capture);

}  // namespace sightline::render
