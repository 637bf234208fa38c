// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "sightline/base/result.hpp"
#include "sightline/observe/detect/detector_options.hpp"

namespace sightline::observe {

/// Refuses numbers out of range, and a rig without cameras.
Status check(const DetectorOptions& o, size_t cameras);

}  // namespace sightline::observe
