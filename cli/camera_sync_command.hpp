// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "commands.hpp"

namespace sightline::cli {

/// `sightline cameras --sync A B`: phase and drift between two cameras, and whether trigger and PTP
/// are set up for one. The exit status.
int sync_cameras(const CamerasOptions& options);

}  // namespace sightline::cli
