// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace sightline::config {

/// Why a name cannot be a camera's, or empty. It is also the name of files, of an RTSP path and of
/// a column in CSV files.
std::string_view camera_name_fault(std::string_view name);

/// Why a name cannot be an object's, or empty. It stands in CSV files, on labels and in SEI units.
std::string_view object_name_fault(std::string_view name);

/// 1 for "m", 0.01 for "cm", 0.001 for "mm", 0.0254 for "in".
std::optional<double> meters_per_unit(std::string_view unit);

/// `name` as seen from the folder of `file`.
std::filesystem::path resolve(const std::filesystem::path& file, const std::string& name);

/// True for a numeric IPv4 or IPv6 address, and for one that only this host can reach.
bool is_numeric_address(const std::string& address);
bool is_loopback_address(const std::string& address);

}  // namespace sightline::config
