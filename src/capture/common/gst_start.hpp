// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/base/result.hpp"

namespace sightline::capture {

/// Initializes GStreamer, once for the process. Any thread.
Status start_gstreamer_for_capture();

}  // namespace sightline::capture
