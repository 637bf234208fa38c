// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/overlay/overlay_style.hpp"

#include <array>

namespace sightline {
namespace {

using Flag = bool OverlayStyle::*;

constexpr std::array<std::string_view, 15> kNames = {
    "circle",  "box2d", "box3d", "outline",   "fill",      "wireframe", "axes",        "cross",
    "ellipse", "label", "trail", "offscreen", "last_seen", "status",    "hidden_lines"};
constexpr std::array<Flag, kNames.size()> kFlags = {
    &OverlayStyle::circle,    &OverlayStyle::box2d,  &OverlayStyle::box3d,
    &OverlayStyle::outline,   &OverlayStyle::fill,   &OverlayStyle::wireframe,
    &OverlayStyle::axes,      &OverlayStyle::cross,  &OverlayStyle::ellipse,
    &OverlayStyle::label,     &OverlayStyle::trail,  &OverlayStyle::offscreen,
    &OverlayStyle::last_seen, &OverlayStyle::status, &OverlayStyle::hidden_lines};

constexpr std::array<std::string_view, 5> kThemes = {"default", "high_contrast", "color_blind",
                                                     "minimal", "detailed"};

/// Wide, with a strong rim, in colors of high brightness: bad screens, bright halls.
OverlayStyle high_contrast() {
  OverlayStyle style;
  style.color = {255, 238, 0};
  style.degraded_color = {255, 140, 0};
  style.coasting_color = {0, 213, 255};
  style.xray_color = {255, 110, 255};
  style.last_seen_color = {255, 255, 255};
  style.fill_opacity = 0.15f;
  style.halo_opacity = 0.85f;
  style.outline_px = 4;
  style.line_px = 3;
  style.font_px = 20;
  return style;
}

/// Of the palette of Okabe and Ito (2008), which people of any color vision tell apart.
OverlayStyle color_blind() {
  OverlayStyle style;
  style.color = {86, 180, 233};
  style.degraded_color = {240, 228, 66};
  style.coasting_color = {213, 94, 0};
  style.xray_color = {204, 121, 167};
  style.outline_px = 3;
  style.halo_opacity = 0.7f;
  return style;
}

/// As little as says where the object is and in what state.
OverlayStyle minimal() {
  OverlayStyle style;
  style.circle = style.fill = style.label = false;
  return style;
}

/// What the estimate says, and its frame.
OverlayStyle detailed() {
  OverlayStyle style;
  style.circle = false;
  style.box3d = style.axes = style.cross = style.ellipse = style.trail = true;
  style.last_seen = true;
  style.shading = Shading::kSmooth;
  style.fill_opacity = 0.35f;
  return style;
}

}  // namespace

std::span<const std::string_view> style_names() { return kNames; }

bool* style_flag(OverlayStyle& style, std::string_view name) {
  for (size_t i = 0; i < kNames.size(); ++i) {
    if (kNames[i] == name) return &(style.*kFlags[i]);
  }
  return nullptr;
}

std::span<const std::string_view> theme_names() { return kThemes; }

std::optional<OverlayStyle> theme_style(std::string_view name) {
  if (name == "default") return OverlayStyle{};
  if (name == "high_contrast") return high_contrast();
  if (name == "color_blind") return color_blind();
  if (name == "minimal") return minimal();
  if (name == "detailed") return detailed();
  return std::nullopt;
}

OverlayStyle bare_style() {
  OverlayStyle style;
  for (const Flag flag : kFlags) style.*flag = false;
  return style;
}

}  // namespace sightline
