// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "sightline/render/mesh/color.hpp"
#include "sightline/render/mesh/shading.hpp"

namespace sightline {

/// What the fill shows: the surface in the state's color, or in the colors that the mesh file
/// gives it (textures, vertices, materials). A mesh without any is shown as kShaded.
enum class FillKind : uint8_t { kShaded, kTextured };

/// What is drawn of one object in one camera. The flags may be combined freely; state is shown by
/// line style and hue whatever is chosen (docs/overlay.md).
struct OverlayStyle {
  bool circle = true;         ///< bounding marker: circle around the projected bounding sphere
  bool box2d = false;         ///< bounding marker: upright rectangle around the silhouette
  bool box3d = false;         ///< oriented box of the mesh, hidden edges dashed
  bool outline = true;        ///< silhouette line
  bool fill = true;           ///< shaded faces, `fill_opacity`
  bool wireframe = false;     ///< feature edges, hidden lines removed
  bool axes = false;          ///< object axes: x red, y green, z blue
  bool cross = false;         ///< where the object's center is
  bool ellipse = false;       ///< `ellipse_sigmas` of the position's covariance, around that center
  bool label = true;          ///< name, state, range, one sigma, age
  bool trail = false;         ///< fading path of the last `trail_seconds`
  bool offscreen = true;      ///< arrow at the border when the object is outside the image
  bool last_seen = false;     ///< when lost: a gray marker where it was last
  bool hidden_lines = false;  ///< wireframe: lines that the object hides are dashed, not left out
  bool status = true;  ///< corner line "NAME: searching" or "NAME: lost" while there is no pose

  Rgb color{70, 225, 120};           ///< tracking
  Rgb degraded_color{255, 170, 0};   ///< degraded
  Rgb coasting_color{80, 190, 255};  ///< coasting (dashed as well)
  Rgb xray_color{225, 90, 255};      ///< the part behind the static scene
  Rgb last_seen_color{170, 170, 170};

  FillKind fill_kind = FillKind::kShaded;
  Shading shading = Shading::kFlat;
  float fill_opacity = 0.25f;   ///< 0 invisible .. 1 opaque
  float halo_opacity = 0.5f;    ///< of the dark rim of lines and outline; 0 none .. 1
  float outline_px = 2.0f;      ///< 2 .. 4; thinner lines lose their color in 4:2:0
  float line_px = 2.0f;         ///< 2 .. 8: box, circle, axes, wireframe, trail
  int font_px = 16;             ///< 8 .. 64, em size
  double ellipse_sigmas = 2.0;  ///< 0.5 .. 10; two hold 86 % of a plane's normal distribution
  double trail_seconds = 1.0;   ///< at most what the track remembers (about one second)

  bool operator==(const OverlayStyle&) const = default;
};

/// The names a person may list, in the order of the flags: "circle", "box2d", ...
std::span<const std::string_view> style_names();

/// The flag of that name, or null if there is none.
bool* style_flag(OverlayStyle& style, std::string_view name);

/// A ready-made style, from which the rest of [overlay] may differ: "default", "high_contrast",
/// "color_blind", "minimal", "detailed" (docs/overlay.md). Empty if there is none of that name.
std::optional<OverlayStyle> theme_style(std::string_view name);
std::span<const std::string_view> theme_names();

/// A style with every flag off and the default colors and sizes, to switch names on in.
OverlayStyle bare_style();

}  // namespace sightline
