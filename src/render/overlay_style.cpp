// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/overlay_style.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

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

}  // namespace

Yuv to_yuv(Rgb color) {
  const double r = color.r / 255.0;
  const double g = color.g / 255.0;
  const double b = color.b / 255.0;
  const double luma = 0.299 * r + 0.587 * g + 0.114 * b;
  const auto byte = [](double value) {
    return static_cast<uint8_t>(std::clamp(std::lround(value), 0L, 255L));
  };
  return {byte(16 + 219 * luma), byte(128 + 224 * (b - luma) / 1.772),
          byte(128 + 224 * (r - luma) / 1.402)};
}

std::span<const std::string_view> style_names() { return kNames; }

bool* style_flag(OverlayStyle& style, std::string_view name) {
  for (size_t i = 0; i < kNames.size(); ++i) {
    if (kNames[i] == name) return &(style.*kFlags[i]);
  }
  return nullptr;
}

OverlayStyle bare_style() {
  OverlayStyle style;
  for (const Flag flag : kFlags) style.*flag = false;
  return style;
}

}  // namespace sightline
