// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

/// Which texts of other hosts are taken: those that an installation file could hold.
namespace sightline::publish {

/// Whole and shortest forms only, as RFC 3629 has it.
bool is_utf8(std::string_view text);
/// Of a camera or a host: 1 to 64 letters, digits, '-', '_', '.', the first a letter or digit.
bool is_camera_name(std::string_view name);
/// 1 to 64 bytes of UTF-8 without commas, quotes and control characters.
bool is_object_name(std::string_view name);
/// With '?' for every byte that is not ASCII, if it is not UTF-8.
std::string printable(std::string text);

}  // namespace sightline::publish
