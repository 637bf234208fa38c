// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/render/overlay/overlay_style.hpp"

namespace sightline {

/// Changes a style by keys of [overlay] that may differ from camera to camera, as TOML
/// (`theme = "minimal"`). Refused as in an installation file: unknown keys, styles, themes, colors,
/// numbers out of range; then nothing changes. Any thread.
Status apply_overlay_keys(std::string_view toml, OverlayStyle& style);

/// Of the names of styles, those that are keys of their own and cannot be listed under "styles".
bool is_overlay_key(std::string_view style);

using OverlayValue = std::variant<bool, int64_t, double, std::string, std::vector<std::string>>;
/// The same keys with the values that make this style; a theme is none of them. Numbers are
/// rounded to six digits.
std::vector<std::pair<std::string, OverlayValue>> overlay_keys(const OverlayStyle& style);

}  // namespace sightline
