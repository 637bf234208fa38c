// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "sightline/capture/v4l2_source.hpp"
#include "v4l2_nodes.hpp"
#include "v4l2_system.hpp"

namespace sightline {

/// open_v4l2_source() on a given system and tree of devices, for tests.
Result<std::unique_ptr<FrameSource>> open_v4l2_source_in(const V4l2Options& options,
                                                         CameraId camera, const std::string& name,
                                                         const V4l2Places& places,
                                                         std::shared_ptr<V4l2System> system);

}  // namespace sightline
