// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "sightline/base/result.hpp"
#include "sightline/render/overlay/camera_renderer.hpp"

namespace sightline::render {

/// What CameraRenderer::create() refuses of an object, ...
Status check_object(const OverlayObject& object, const std::string& camera);
/// ... and of what the camera's parts are made for.
Status check_parts(const CalibratedCamera& camera, const RayTable* rays, const StaticDepth* scene,
                   const RenderOptions& options);

}  // namespace sightline::render
