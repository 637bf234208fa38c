// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace sightline::cli {

/// Of `sightline cameras`.
struct CamerasOptions {
  std::string source;             ///< to be probed; empty: list what is plugged in
  std::vector<std::string> sync;  ///< two sources whose timing is compared; or empty
  std::filesystem::path config;   ///< then sources are the names of cameras in it
  std::filesystem::path save;     ///< PNG of the newest frame
  double seconds = 5;
  bool json = false;
};

/// `sightline cameras --sync A B`: phase and drift between two cameras, and whether trigger and PTP
/// are set up for one. The exit status.
int sync_cameras(const CamerasOptions& options);

}  // namespace sightline::cli
