// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace sightline {

/// Full-range sRGB, as people write colours.
struct Rgb {
  uint8_t r = 0, g = 0, b = 0;
  friend constexpr bool operator==(const Rgb&, const Rgb&) = default;
};

/// BT.601 limited range, as frames are.
struct Yuv {
  uint8_t y = 16, u = 128, v = 128;
  friend constexpr bool operator==(const Yuv&, const Yuv&) = default;
};

/// ITU-R BT.601-7, limited range (Y 16..235, U and V 16..240), rounded.
Yuv to_yuv(Rgb color);

/// What the fill shows: the surface in the state's colour, or in the colours that the mesh file
/// gives it (textures, vertices, materials). A mesh without any is shown as kShaded.
enum class FillKind : uint8_t { kShaded, kTextured };

/// How the light falls: on faces, or on a surface that is round between the mesh's creases.
enum class Shading : uint8_t { kFlat, kSmooth };

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
  bool cross = false;         ///< where the object's centre is
  bool ellipse = false;       ///< `ellipse_sigmas` of the position's covariance, around that centre
  bool label = true;          ///< name, state, range, one sigma, age
  bool trail = false;         ///< fading path of the last `trail_seconds`
  bool offscreen = true;      ///< arrow at the border when the object is outside the picture
  bool last_seen = false;     ///< when lost: a grey marker where it was last
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
  float outline_px = 2.0f;      ///< 2 .. 4; thinner lines lose their colour in 4:2:0
  float line_px = 2.0f;         ///< 2 .. 8: box, circle, axes, wireframe, trail
  int font_px = 16;             ///< 8 .. 64, em size
  double ellipse_sigmas = 2.0;  ///< 0.5 .. 10; two hold 86 % of a plane's normal distribution
  double trail_seconds = 1.0;   ///< at most what the track remembers (about one second)
};

/// The names a person may list, in the order of the flags: "circle", "box2d", ...
std::span<const std::string_view> style_names();

/// The flag of that name, or null if there is none.
bool* style_flag(OverlayStyle& style, std::string_view name);

/// A ready-made style, from which the rest of [overlay] may differ: "default", "high_contrast",
/// "colour_blind", "minimal", "detailed" (docs/overlay.md). Empty if there is none of that name.
std::optional<OverlayStyle> theme_style(std::string_view name);
std::span<const std::string_view> theme_names();

/// A style with every flag off and the default colours and sizes, to switch names on in.
OverlayStyle bare_style();

}  // namespace sightline
