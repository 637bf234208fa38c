// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/capture/common/device_info.hpp"

namespace sightline::cli {

/// What is plugged in, by V4L2, Aravis and libcamera, with formats.
struct DeviceListing {
  std::vector<DeviceInfo> devices;
  std::vector<std::string> notes;  ///< kinds that could not be asked, and why
};

/// Asks this host; takes a second or two (GigE Vision cameras answer a broadcast).
DeviceListing list_devices();

/// As an installation names it: "SCHEME:ID".
std::string source_of(const DeviceInfo& device);

/// As `sightline cameras --json` prints it, and back; `where` names the file in errors.
nlohmann::ordered_json json_of(const DeviceListing& listing);
Result<DeviceListing> parse_device_listing(const std::string& text, const std::string& where);

}  // namespace sightline::cli
