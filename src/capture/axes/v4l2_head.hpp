// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "capture/v4l2/v4l2_nodes.hpp"
#include "capture/v4l2/v4l2_system.hpp"
#include "sightline/capture/axes/axis_source.hpp"

namespace sightline::capture {

/// The head of a camera of the kernel, by its controls, on a given system and tree of devices, for
/// tests.
/// Errors: those of choose_v4l2_node() and V4l2Device::open(); kInvalidInput, a control is missing
/// or cannot be read, the text lists those that are there.
Result<std::unique_ptr<AxisSource>> open_v4l2_head_in(const AxisSourceOptions& options,
                                                      const std::string& name,
                                                      const V4l2Places& places,
                                                      const std::shared_ptr<V4l2System>& system);

}  // namespace sightline::capture
