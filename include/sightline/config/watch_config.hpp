// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace sightline {

/// Whether the cameras' places are watched over while the rig runs.
struct WatchConfig {
  bool enabled = true;
  bool background = true;     ///< also by what stands still in each camera's picture
  bool auto_recover = false;  ///< take a proposed place over without being asked

  bool operator==(const WatchConfig&) const = default;
};

}  // namespace sightline
