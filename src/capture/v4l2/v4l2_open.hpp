// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <stop_token>
#include <string>

#include "capture/v4l2/v4l2_nodes.hpp"
#include "capture/v4l2/v4l2_system.hpp"
#include "sightline/capture/v4l2/v4l2_source.hpp"

namespace sightline::capture {

/// open_v4l2_source() on a given system and tree of devices, for tests.
Result<std::unique_ptr<FrameSource>> open_v4l2_source_in(const V4l2Options& options,
                                                         CameraId camera, const std::string& name,
                                                         const V4l2Places& places,
                                                         const std::shared_ptr<V4l2System>& system,
                                                         const std::stop_token& stop = {});

}  // namespace sightline::capture
