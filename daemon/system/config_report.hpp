// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace sightline {

/// Which configuration is in force, and why the newest is not. Times in UTC [ns].
struct ConfigReport {
  std::filesystem::path file;
  std::string content;  ///< hash of the file in force, 16 hexadecimal digits
  int64_t loaded_utc_ns = 0;
  std::string refused;  ///< why the newest was refused; empty: it is the one in force
  int64_t refused_utc_ns = 0;
  bool calibration_report = false;  ///< a report.html lay beside the calibration then
};

}  // namespace sightline
