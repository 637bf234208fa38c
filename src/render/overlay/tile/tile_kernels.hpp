// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

namespace sightline::tile {

/// Row kernels of the tile compositor. Whole-number arithmetic (and one float product that is only
/// compared), so plain loops, SSE2, AVX2 and NEON give the same bits.

/// The silhouette, blurred with the binomial filter of seven taps, tells a pixel's distance to its
/// edge: kInside deep inside, 0 outside, half of it on the edge.
inline constexpr int kInside = 240;

/// A straight ramp of alpha over blurred values: 0 at `low`, 255 at `low` + 4080 / gain.
struct Ramp {
  uint16_t low = 0;
  uint16_t gain = 0;  ///< alpha per step, times 16; 0: never
};

/// How one row is colored; the same for the whole tile but for the pointers.
struct InkStyle {
  uint8_t luma = 0;       ///< of the visible part
  uint8_t xray_luma = 0;  ///< of the part behind the scene
  uint8_t fill_alpha = 0;
  uint8_t outline_alpha = 255;
  uint8_t xray_outline_alpha = 190;
  uint8_t halo_alpha = 150;
  bool dash_visible = false;
  Ramp outline, halo;
};

/// What classify() found in a row: columns, ends excluded. All zero where nothing is covered.
struct CoveredSpan {
  int first = 0, end = 0;  ///< from the first to the last covered pixel
  int gap = 0;             ///< end of the run without a gap that begins at `first`
  int last_run = 0;        ///< begin of the one that ends at `end`
  bool hidden = false;     ///< the scene hides any of it
  int count() const { return end - first; }
};

struct RowIn {
  const uint8_t* mask;            ///< 255 on the object, else 0
  const uint8_t* hidden;          ///< 255 where the scene hides it, else 0
  const uint8_t* blurred;         ///< 0..kInside
  const uint8_t* blurred_hidden;  ///< 0..kInside
  const uint8_t* shade;
  const uint8_t* hatch;  ///< fill alpha of the hidden part
  /// Dashes by direction from the tile's middle (diamond angle), so many to a turn; 0: none.
  float dashes;
  float first_dx, dy;  ///< of the row's first pixel, from the middle
  /// Luma of the visible part's own colors; null: it has that of the ink_style.
  const uint8_t* own_luma = nullptr;
};

/// Premultiplied luma, total alpha, and the share of each hue in it.
struct RowOut {
  uint8_t* luma;
  uint8_t* alpha;
  uint8_t* visible_ink;
  uint8_t* xray_ink;
  uint8_t* own_ink = nullptr;  ///< share of the own colors; only with own_luma
};

struct ChromaIn {
  const uint8_t* alpha[2];  ///< two rows of luma resolution each
  const uint8_t* visible_ink[2];
  const uint8_t* xray_ink[2];
  uint8_t u = 128, v = 128, xray_u = 128, xray_v = 128;
  const uint8_t* own_ink[2] = {};  ///< null: none
  const uint8_t *own_u[2] = {}, *own_v[2] = {};
};

/// Text: two rows of strokes and of alpha, and its hue.
struct TextChromaIn {
  const uint8_t* strokes[2];
  const uint8_t* alpha[2];
  uint8_t u = 128, v = 128;
};

struct Kernels {
  /// mask and hidden from 1/z of object and scene: hidden where scene > object * factor. `scene`
  /// may be null. ORs the mask into `columns`.
  CoveredSpan (*classify)(const float* object, const float* scene, float factor, uint8_t* mask,
                          uint8_t* hidden, uint8_t* columns, int n);
  /// Down the columns: seven rows of masks, 0 .. 15 * 64.
  void (*blur_down)(const std::array<const uint8_t*, 7>& rows, uint16_t* out, int n);
  /// Along the row: `in` has three more values at either end.
  void (*blur_along)(const uint16_t* in, uint8_t* out, int n);
  void (*compose)(const InkStyle& ink_style, const RowIn& in, const RowOut& out, int n);
  /// Halves two rows: n chroma samples.
  void (*chroma)(const ChromaIn& in, uint8_t* u, uint8_t* v, uint8_t* alpha, int n);
  /// One row of text on its halo: premultiplied luma; `alpha` holds the halo and takes the total.
  void (*text_luma)(const uint8_t* strokes, uint8_t luma, uint8_t* alpha, uint8_t* out, int n);
  /// Halves two rows of it: n chroma samples.
  void (*text_chroma)(const TextChromaIn& in, uint8_t* u, uint8_t* v, uint8_t* alpha, int n);
};

/// The best that this processor runs.
const Kernels& kernels();

/// By the vectors that each processor of the target has.
extern const Kernels kBaseKernels;
#ifdef SIGHTLINE_X86_64
extern const Kernels kAvx2Kernels;
#endif

}  // namespace sightline::tile
