// SPDX-License-Identifier: Apache-2.0
// The kernels' one source, compiled for any processor of the target (SSE2, NEON) and for AVX2; in
// the tests once more as plain loops (SIGHTLINE_TILE_PLAIN). Includes nothing but their header and
// that of the vectors, so that no inline function of a library is compiled for AVX2 and then
// shared.
#include "render/overlay/tile/tile_kernels.hpp"
#include "sightline/base/vectors.hpp"

namespace sightline::tile {
namespace {

using U8 = uint8_t;
using U16 = uint16_t;

/// x / 255, rounded, for x up to 65025.
inline U16 div255(U16 x) {
  const U16 t = static_cast<U16>(x + 128);
  return static_cast<U16>(static_cast<U16>(t + (t >> 8)) >> 8);
}

inline U16 mul255(U16 a, U16 b) { return div255(static_cast<U16>(a * b)); }

/// `yes` where the mask is 255, `no` where it is 0; both up to 255.
inline U16 choose(U16 mask, U16 yes, U16 no) {
  return static_cast<U16>((yes & mask) | (no & static_cast<U16>(255 - mask)));
}

inline U16 ramp(U16 value, U16 low, U16 gain) {
  const U16 above = value > low ? static_cast<U16>(value - low) : U16{0};
  const U16 alpha = static_cast<U16>(static_cast<U16>(above * gain) >> 4);
  return alpha < 255 ? alpha : U16{255};
}

/// Columns of covered pixels, gathered in order.
struct Runs {
  int first = -1, gap = -1, last_run = 0, end = -1;

  /// 32 pixels from `x`, a bit each.
  void add(unsigned covered, int x) {
    if (covered == 0) {
      if (first >= 0 && gap < 0) gap = x;
      return;
    }
    const int top = 31 - __builtin_clz(covered);
    const unsigned gaps_below = ~covered & ((1u << top) - 1);
    if (gaps_below != 0) {
      last_run = x + 32 - __builtin_clz(gaps_below);
    } else if (end != x) {
      last_run = x;
    }
    end = x + top + 1;
    unsigned gaps = ~covered;
    if (first < 0) {
      const int lowest = __builtin_ctz(covered);
      first = x + lowest;
      gaps &= ~0u << lowest;
    }
    if (gap < 0 && gaps != 0) gap = x + __builtin_ctz(gaps);
  }
  CoveredSpan result(bool hidden) const {
    if (first < 0) return {};
    return {first, end, gap < 0 || gap > end ? end : gap, last_run, hidden};
  }
};

#ifndef SIGHTLINE_TILE_PLAIN
using vectors::Bytes;
using vectors::Floats;
constexpr int kParts = 32 / vectors::kBytes;  // of 32 pixels

/// Where so many pixels are nearer than others times a factor: 255 there, else 0.
inline Bytes nearer(const float* these, const float* others, float factor) {
  vectors::Ints in[4];
  for (int k = 0; k < 4; ++k) {
    const Floats far = others == nullptr
                           ? Floats{}
                           : vectors::load<Floats>(others + k * vectors::kFloats) * factor;
    in[k] = vectors::load<Floats>(these + k * vectors::kFloats) > far;
  }
  return vectors::bytes_of_four(in);
}

/// classify() of a row of at least 32 pixels. Tells whether anything is behind the scene.
inline bool classify32(const float* object, const float* scene, float factor, U8* mask, U8* hidden,
                       U8* columns, int n, Runs& runs) {
  Bytes any_hidden = {};
  // The last step overlaps the one before it; what it tells anew is shifted out.
  for (int begin = 0; begin < n; begin += 32) {
    const int x = begin + 32 <= n ? begin : n - 32;
    Bytes inside[kParts];
    for (int k = 0; k < kParts; ++k) {
      const int at = x + k * vectors::kBytes;
      inside[k] = nearer(object + at, nullptr, 1);
      vectors::store(mask + at, inside[k]);
    }
    const uint32_t covered = vectors::bits_of_32(inside);
    runs.add(covered >> (begin - x), begin);
    for (int k = 0; k < kParts; ++k) {
      const int at = x + k * vectors::kBytes;
      Bytes behind = {};
      if (covered != 0) {
        if (scene != nullptr) behind = inside[k] & nearer(scene + at, object + at, factor);
        vectors::store(columns + at, vectors::load<Bytes>(columns + at) | inside[k]);
      }
      vectors::store(hidden + at, behind);
      any_hidden |= behind;
    }
  }
  return vectors::any(any_hidden);
}
#endif

/// Tells whether anything is behind the scene.
bool classify_rest(const float* __restrict object, const float* __restrict scene, float factor,
                   U8* __restrict mask, U8* __restrict hidden, U8* __restrict columns, int n) {
  int behind = 0;
  if (scene == nullptr) {
    for (int x = 0; x < n; ++x) {
      const int in = object[x] > 0 ? 255 : 0;
      mask[x] = static_cast<U8>(in);
      hidden[x] = 0;
      columns[x] = static_cast<U8>(columns[x] | in);
    }
  } else {
    for (int x = 0; x < n; ++x) {
      const int in = object[x] > 0 ? 255 : 0;
      const int out_of_sight = scene[x] > object[x] * factor ? in : 0;
      mask[x] = static_cast<U8>(in);
      hidden[x] = static_cast<U8>(out_of_sight);
      columns[x] = static_cast<U8>(columns[x] | in);
      behind |= out_of_sight;
    }
  }
  return behind != 0;
}

CoveredSpan classify(const float* object, const float* scene, float factor, U8* mask, U8* hidden,
                     U8* columns, int n) {
  Runs runs;
#ifndef SIGHTLINE_TILE_PLAIN
  if (n >= 32) {
    const bool hides = classify32(object, scene, factor, mask, hidden, columns, n, runs);
    return runs.result(hides);
  }
#endif
  const bool behind = classify_rest(object, scene, factor, mask, hidden, columns, n);
  for (int x = 0; x < n; x += 32) {
    const int count = n - x < 32 ? n - x : 32;
    unsigned covered = 0;
    for (int k = 0; k < count; ++k) covered |= static_cast<unsigned>(mask[x + k] & 1) << k;
    runs.add(covered, x);
  }
  return runs.result(behind);
}

void blur_down(const std::array<const U8*, 7>& rows, U16* __restrict out, int n) {
  const U8* a = rows[0];
  const U8* b = rows[1];
  const U8* c = rows[2];
  const U8* d = rows[3];
  const U8* e = rows[4];
  const U8* f = rows[5];
  const U8* g = rows[6];
  for (int x = 0; x < n; ++x) {
    const U16 ends = static_cast<U16>((a[x] & 15) + (g[x] & 15));
    const U16 next = static_cast<U16>((b[x] & 15) + (f[x] & 15));
    const U16 near = static_cast<U16>((c[x] & 15) + (e[x] & 15));
    out[x] = static_cast<U16>(ends + 6 * next + 15 * near + 20 * (d[x] & 15));
  }
}

void blur_along(const U16* __restrict in, U8* __restrict out, int n) {
  for (int x = 0; x < n; ++x) {
    const U16 ends = static_cast<U16>(in[x] + in[x + 6]);
    const U16 next = static_cast<U16>(in[x + 1] + in[x + 5]);
    const U16 near = static_cast<U16>(in[x + 2] + in[x + 4]);
    const U16 sum = static_cast<U16>(ends + 6 * next + 15 * near + 20 * in[x + 3]);
    out[x] = static_cast<U8>(sum >> 8);
  }
}

void dash(float first_dx, float dy, float dashes, U8* __restrict out, int n) {
  const float height = dy < 0 ? -dy : dy;
  const float half_turns = dashes * 0.5f;
  for (int x = 0; x < n; ++x) {
    const float dx = first_dx + static_cast<float>(x);
    const float share = dx / ((dx < 0 ? -dx : dx) + height + 1e-3f);
    const float angle = dy < 0 ? 3.0f + share : 1.0f - share;
    out[x] = (static_cast<int>(angle * half_turns) & 1) != 0 ? U8{0} : U8{255};
  }
}

/// Pointers are parameters: only there does g++ take `restrict` at its word.
template <bool kOwn>
[[gnu::always_inline]] inline void compose_row(
    const InkStyle ink_style, const U8* __restrict mask, const U8* __restrict hidden,
    const U8* __restrict blurred, const U8* __restrict blurred_hidden, const U8* __restrict shade,
    const U8* __restrict dashes, const U8* __restrict hatch, const U8* __restrict own_luma,
    U8* __restrict luma, U8* __restrict alpha, U8* __restrict visible_ink, U8* __restrict xray_ink,
    U8* __restrict own_ink, int n) {
  const Ramp outline = ink_style.outline;
  const Ramp halo = ink_style.halo;
  const U16 solid = ink_style.dash_visible ? 0 : 255;
  const U16 span = static_cast<U16>(ink_style.luma - 16);
  const U16 xray_span = static_cast<U16>(ink_style.xray_luma - 16);
  const U16 fill_alpha = ink_style.fill_alpha;
  const U16 line_alpha = ink_style.outline_alpha;
  const U16 xray_line_alpha = ink_style.xray_outline_alpha;
  const U16 halo_alpha = ink_style.halo_alpha;
  for (int x = 0; x < n; ++x) {
    const U16 s = blurred[x];
    const U16 inside = mask[x];
    const U16 behind = hidden[x];
    const U16 other = static_cast<U16>(kInside - s);
    const U16 edge = s < other ? s : other;
    const U16 line_behind = static_cast<U16>(2 * blurred_hidden[x]) > s ? U16{255} : U16{0};
    const U16 on = static_cast<U16>(dashes[x] | choose(line_behind, 0, solid));
    const U16 opacity = choose(line_behind, xray_line_alpha, line_alpha);
    const U16 line = static_cast<U16>(mul255(ramp(edge, outline.low, outline.gain), opacity) & on);
    const U16 fill = static_cast<U16>(choose(behind, hatch[x], fill_alpha) & inside);
    const U16 shadow = mul255(ramp(s, halo.low, halo.gain), halo_alpha);
    const U16 dark = static_cast<U16>(shadow & on & static_cast<U16>(255 - inside));
    const U16 rest = static_cast<U16>(255 - line);
    const U16 fill_weight = mul255(rest, fill);
    const U16 dark_weight = mul255(rest, dark);
    const U16 light = static_cast<U16>(80 + (static_cast<U16>(175 * shade[x]) >> 8));
    U16 fill_luma = static_cast<U16>(16 + mul255(choose(behind, xray_span, span), light));
    if constexpr (kOwn) fill_luma = choose(behind, fill_luma, own_luma[x]);
    const U16 line_luma = static_cast<U16>(16 + choose(line_behind, xray_span, span));
    luma[x] = static_cast<U8>(
        div255(static_cast<U16>(line * line_luma + fill_weight * fill_luma + dark_weight * 16)));
    alpha[x] = static_cast<U8>(line + fill_weight + dark_weight);
    const U16 seen = choose(behind, 0, fill_weight);
    visible_ink[x] = static_cast<U8>(choose(line_behind, 0, line) + (kOwn ? 0 : seen));
    if constexpr (kOwn) own_ink[x] = static_cast<U8>(seen);
    xray_ink[x] = static_cast<U8>(choose(line_behind, line, 0) + choose(behind, fill_weight, 0));
  }
}

/// The same far inside the silhouette, where no outline is: a third of the work.
template <bool kOwn>
inline void compose_inside(const InkStyle ink_style, const U8* __restrict hidden,
                           const U8* __restrict shade, const U8* __restrict hatch,
                           const U8* __restrict own_luma, U8* __restrict luma, U8* __restrict alpha,
                           U8* __restrict visible_ink, U8* __restrict xray_ink,
                           U8* __restrict own_ink, int n) {
  const U16 span = static_cast<U16>(ink_style.luma - 16);
  const U16 xray_span = static_cast<U16>(ink_style.xray_luma - 16);
  const U16 fill_alpha = ink_style.fill_alpha;
  for (int x = 0; x < n; ++x) {
    const U16 behind = hidden[x];
    const U16 fill = choose(behind, hatch[x], fill_alpha);
    const U16 light = static_cast<U16>(80 + (static_cast<U16>(175 * shade[x]) >> 8));
    U16 fill_luma = static_cast<U16>(16 + mul255(choose(behind, xray_span, span), light));
    if constexpr (kOwn) fill_luma = choose(behind, fill_luma, own_luma[x]);
    luma[x] = static_cast<U8>(div255(static_cast<U16>(fill * fill_luma)));
    alpha[x] = static_cast<U8>(fill);
    const U16 seen = choose(behind, 0, fill);
    visible_ink[x] = static_cast<U8>(kOwn ? 0 : seen);
    if constexpr (kOwn) own_ink[x] = static_cast<U8>(seen);
    xray_ink[x] = static_cast<U8>(choose(behind, fill, 0));
  }
}

constexpr int kBlock = 32;

/// Whether all bytes of a block are `value`.
inline bool all_are(const U8* bytes, U8 value) {
  const uint64_t wanted = value * 0x0101010101010101u;
  uint64_t words[kBlock / 8];
  __builtin_memcpy(words, bytes, sizeof(words));
  uint64_t off = 0;
  for (const uint64_t word : words) off |= word ^ wanted;
  return off == 0;
}

/// Block by block: most of a row is inside or outside of the outline.
template <bool kOwn>
void compose_blocks(const InkStyle& ink_style, const RowIn& in, const RowOut& to, int n) {
  U8 dashes[kBlock];
  __builtin_memset(dashes, 255, sizeof(dashes));
  for (int x = 0; x < n; x += kBlock) {
    const int count = n - x < kBlock ? n - x : kBlock;
    const bool whole = count == kBlock;
    const U8* const own_luma = kOwn ? in.own_luma + x : nullptr;
    U8* const own_ink = kOwn ? to.own_ink + x : nullptr;
    if (whole && all_are(in.blurred + x, 0)) {
      for (U8* plane : {to.luma, to.alpha, to.visible_ink, to.xray_ink})
        __builtin_memset(plane + x, 0, kBlock);
      if constexpr (kOwn) __builtin_memset(own_ink, 0, kBlock);
    } else if (whole && all_are(in.blurred + x, kInside)) {
      compose_inside<kOwn>(ink_style, in.hidden + x, in.shade + x, in.hatch + x, own_luma,
                           to.luma + x, to.alpha + x, to.visible_ink + x, to.xray_ink + x, own_ink,
                           kBlock);
    } else {
      if (in.dashes > 0) dash(in.first_dx + static_cast<float>(x), in.dy, in.dashes, dashes, count);
      const auto all = [&](int pixels) __attribute__((always_inline)) {
        compose_row<kOwn>(ink_style, in.mask + x, in.hidden + x, in.blurred + x,
                          in.blurred_hidden + x, in.shade + x, dashes, in.hatch + x, own_luma,
                          to.luma + x, to.alpha + x, to.visible_ink + x, to.xray_ink + x, own_ink,
                          pixels);
      };
      // A constant number needs no loop for what is left over.
      if (whole) {
        all(kBlock);
      } else {
        all(count);
      }
    }
  }
}

void compose(const InkStyle& ink_style, const RowIn& in, const RowOut& to, int n) {
  if (in.own_luma != nullptr) {
    compose_blocks<true>(ink_style, in, to, n);
  } else {
    compose_blocks<false>(ink_style, in, to, n);
  }
}

inline U16 quarter(const U8* top, const U8* bottom, int x) {
  return static_cast<U16>((top[2 * x] + top[2 * x + 1] + bottom[2 * x] + bottom[2 * x + 1] + 2) >>
                          2);
}

void plain_chroma(const ChromaIn& in, U8* __restrict u, U8* __restrict v, U8* __restrict alpha,
                  int n) {
  const U8* __restrict alpha0 = in.alpha[0];
  const U8* __restrict alpha1 = in.alpha[1];
  const U8* __restrict visible0 = in.visible_ink[0];
  const U8* __restrict visible1 = in.visible_ink[1];
  const U8* __restrict xray0 = in.xray_ink[0];
  const U8* __restrict xray1 = in.xray_ink[1];
  const U16 color_u = in.u;
  const U16 color_v = in.v;
  const U16 xray_u = in.xray_u;
  const U16 xray_v = in.xray_v;
  for (int x = 0; x < n; ++x) {
    const U16 seen = quarter(visible0, visible1, x);
    const U16 behind = quarter(xray0, xray1, x);
    const U16 ink =
        static_cast<U16>(seen + behind) < 255 ? static_cast<U16>(seen + behind) : U16{255};
    const U16 xray = static_cast<U16>(ink - seen);
    const U16 total = quarter(alpha0, alpha1, x);
    const U16 max = total > ink ? total : ink;
    const U16 gray = static_cast<U16>((max - ink) * 128);
    alpha[x] = static_cast<U8>(max);
    u[x] = static_cast<U8>(div255(static_cast<U16>(seen * color_u + xray * xray_u + gray)));
    v[x] = static_cast<U8>(div255(static_cast<U16>(seen * color_v + xray * xray_v + gray)));
  }
}

/// Of four pixels, a color weighted by the ink that each has of it; at most 255 * 255.
inline U16 weighted(const U8* ink0, const U8* ink1, const U8* color0, const U8* color1, int x) {
  const uint32_t sum = static_cast<uint32_t>(ink0[2 * x] * color0[2 * x]) +
                       static_cast<uint32_t>(ink0[2 * x + 1] * color0[2 * x + 1]) +
                       static_cast<uint32_t>(ink1[2 * x] * color1[2 * x]) +
                       static_cast<uint32_t>(ink1[2 * x + 1] * color1[2 * x + 1]);
  return static_cast<U16>((sum + 2) >> 2);
}

/// With colors of each pixel's own. What four roundings add is cut off at full opacity.
void own_chroma(const ChromaIn& in, U8* __restrict u, U8* __restrict v, U8* __restrict alpha,
                int n) {
  const uint32_t color_u = in.u, color_v = in.v, xray_u = in.xray_u, xray_v = in.xray_v;
  for (int x = 0; x < n; ++x) {
    const uint32_t seen = quarter(in.visible_ink[0], in.visible_ink[1], x);
    const uint32_t behind = quarter(in.xray_ink[0], in.xray_ink[1], x);
    const uint32_t own = quarter(in.own_ink[0], in.own_ink[1], x);
    const uint32_t total = quarter(in.alpha[0], in.alpha[1], x);
    const uint32_t ink = seen + behind + own;
    const uint32_t max = total > ink ? total : ink;
    const uint32_t gray = (max - ink) * 128 + 127;
    const uint32_t sum_u = seen * color_u + behind * xray_u + gray +
                           weighted(in.own_ink[0], in.own_ink[1], in.own_u[0], in.own_u[1], x);
    const uint32_t sum_v = seen * color_v + behind * xray_v + gray +
                           weighted(in.own_ink[0], in.own_ink[1], in.own_v[0], in.own_v[1], x);
    alpha[x] = static_cast<U8>(max < 255 ? max : 255);
    u[x] = static_cast<U8>(sum_u / 255 < 255 ? sum_u / 255 : 255);
    v[x] = static_cast<U8>(sum_v / 255 < 255 ? sum_v / 255 : 255);
  }
}

void chroma(const ChromaIn& in, U8* u, U8* v, U8* alpha, int n) {
  if (in.own_ink[0] != nullptr) {
    own_chroma(in, u, v, alpha, n);
  } else {
    plain_chroma(in, u, v, alpha, n);
  }
}

void text_luma(const U8* __restrict strokes, U8 color, U8* __restrict alpha, U8* __restrict out,
               int n) {
  for (int x = 0; x < n; ++x) {
    const U16 ink = strokes[x];
    const U16 total = alpha[x] > ink ? alpha[x] : ink;
    const U16 dark = static_cast<U16>(total - ink);
    alpha[x] = static_cast<U8>(total);
    out[x] = static_cast<U8>(div255(static_cast<U16>(ink * color + dark * 16)));
  }
}

inline void text_chroma_row(const U8* __restrict ink0, const U8* __restrict ink1,
                            const U8* __restrict alpha0, const U8* __restrict alpha1, U16 color_u,
                            U16 color_v, U8* __restrict u, U8* __restrict v, U8* __restrict alpha,
                            int n) {
  for (int x = 0; x < n; ++x) {
    const U16 ink = quarter(ink0, ink1, x);
    const U16 covered = quarter(alpha0, alpha1, x);
    const U16 total = covered > ink ? covered : ink;
    const U16 gray = static_cast<U16>((total - ink) * 128);
    alpha[x] = static_cast<U8>(total);
    u[x] = static_cast<U8>(div255(static_cast<U16>(ink * color_u + gray)));
    v[x] = static_cast<U8>(div255(static_cast<U16>(ink * color_v + gray)));
  }
}

void text_chroma(const TextChromaIn& in, U8* u, U8* v, U8* alpha, int n) {
  text_chroma_row(in.strokes[0], in.strokes[1], in.alpha[0], in.alpha[1], in.u, in.v, u, v, alpha,
                  n);
}

}  // namespace

#ifndef SIGHTLINE_TILE_KERNELS
#error "name the kernel table that this file makes"
#endif
const Kernels SIGHTLINE_TILE_KERNELS = {classify, blur_down, blur_along, compose,
                                        chroma,   text_luma, text_chroma};

}  // namespace sightline::tile
