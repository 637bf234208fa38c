// SPDX-License-Identifier: Apache-2.0
// Bodies that order another overlay, through JSON and TOML to the style.
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string_view>

#include "control/api_requests.hpp"
#include "sightline/base/check.hpp"
#include "sightline/config/overlay_keys.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace sightline;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto request = control::parse_overlay(text);
  if (!request) return 0;
  OverlayStyle style;
  const Status done = apply_overlay_keys(request->keys, style);
  if (!done) {
    SL_CHECK(!done.error().text.empty(), "every refusal says why");
    SL_CHECK(style == OverlayStyle{}, "and changes nothing");
    return 0;
  }
  SL_CHECK(style.fill_opacity >= 0 && style.fill_opacity <= 1, "a share");
  SL_CHECK(style.line_px >= 2 && style.line_px <= 8, "a width");
  SL_CHECK(style.font_px >= 8 && style.font_px <= 64, "a size");
  SL_CHECK(style.trail_seconds >= 0 && style.trail_seconds <= 3, "a time");
  // What is said of it makes the same again.
  nlohmann::json json;
  for (const auto& [key, value] : overlay_keys(style)) {
    std::visit([&, &name = key](const auto& v) { json[name] = v; }, value);
  }
  const auto again = control::parse_overlay(json.dump());
  OverlayStyle same;
  SL_CHECK(again && apply_overlay_keys(again->keys, same), "it can be said");
  SL_CHECK(overlay_keys(same) == overlay_keys(style), "the same");
  return 0;
}
