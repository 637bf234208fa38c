// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sightline/capture/aravis/aravis_source.hpp"
#include "sightline/capture/common/camera_sync.hpp"

namespace sightline::cli {

/// What is known of one of the two cameras.
struct SyncCamera {
  std::string name;
  bool aravis = false;
  AravisOptions settings;              ///< with aravis
  std::optional<AravisStatus> status;  ///< with aravis, once it was open
  std::string problem;                 ///< it was lost, or sent nothing
  double exposure_error_ms = 0;        ///< median bound of its capture times
};

/// What a person should know of their timing: how they are triggered, what PTP does, what is
/// missing and what to do about it. One finding each.
std::vector<std::string> sync_advice(const SyncCamera& a, const SyncCamera& b,
                                     const SyncReport& report);

/// "locked", "drifting" or "unknown", by what the measurement can tell.
std::string sync_verdict(const SyncReport& report);

}  // namespace sightline::cli
