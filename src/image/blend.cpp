// SPDX-License-Identifier: Apache-2.0
#include "sightline/image/blend.hpp"

#include <algorithm>

#include "image/blend_kernels.hpp"
#include "sightline/base/check.hpp"
#include "sightline/base/cpu.hpp"

namespace sightline::image::blend {

void plane_row_scalar(uint8_t* frame, const uint8_t* color, const uint8_t* alpha, int n) {
  for (int i = 0; i < n; ++i) frame[i] = over(frame[i], color[i], alpha[i]);
}

void pair_row_scalar(uint8_t* frame_uv, const uint8_t* u, const uint8_t* v, const uint8_t* alpha,
                     int n) {
  for (int i = 0; i < n; ++i) {
    frame_uv[2 * i] = over(frame_uv[2 * i], u[i], alpha[i]);
    frame_uv[2 * i + 1] = over(frame_uv[2 * i + 1], v[i], alpha[i]);
  }
}

namespace {

const Kernels& kernels() {
#ifdef SIGHTLINE_X86_64
  static const Kernels& chosen = cpu_has_avx2() ? kAvx2 : kVector;
  return chosen;
#else
  return kVector;
#endif
}

// The part of a tile that lies in the frame, in tile coordinates: [first, last).
struct Clip {
  int first = 0, last = 0;
  Clip(int position, int tile_size, int frame_size) {
    // In 64 bits, so that no position overflows.
    first = static_cast<int>(std::clamp<int64_t>(-int64_t{position}, 0, tile_size));
    last = static_cast<int>(
        std::clamp<int64_t>(int64_t{frame_size} - position, first, int64_t{tile_size}));
  }
  int count() const { return last - first; }
};

void blend_plane(int x, int y, const PlaneView& color, const PlaneView& alpha,
                 const MutablePlaneView& frame) {
  const Clip columns(x, std::min(color.width, alpha.width), frame.width);
  const Clip rows(y, std::min(color.height, alpha.height), frame.height);
  if (columns.count() <= 0) return;
  for (int row = rows.first; row < rows.last; ++row) {
    kernels().plane(frame.row(y + row) + x + columns.first, color.row(row) + columns.first,
                    alpha.row(row) + columns.first, columns.count());
  }
}

void check_tile(const OverlayTileView& tile) {
  SL_CHECK((tile.x & 1) == 0 && (tile.y & 1) == 0, "a tile starts at an even pixel");
}

}  // namespace
}  // namespace sightline::image::blend

namespace sightline {

using namespace image;

void blend_tile(const OverlayTileView& tile, const MutableI420View& frame) {
  blend::check_tile(tile);
  blend::blend_plane(tile.x, tile.y, tile.luma, tile.alpha, frame.y);
  blend::blend_plane(tile.x / 2, tile.y / 2, tile.u, tile.chroma_alpha, frame.u);
  blend::blend_plane(tile.x / 2, tile.y / 2, tile.v, tile.chroma_alpha, frame.v);
}

void blend_tile(const OverlayTileView& tile, const MutableNv12View& frame) {
  blend::check_tile(tile);
  blend::blend_plane(tile.x, tile.y, tile.luma, tile.alpha, frame.y);
  const int x = tile.x / 2, y = tile.y / 2;
  const PlaneView& alpha = tile.chroma_alpha;
  const blend::Clip columns(x, std::min({tile.u.width, tile.v.width, alpha.width}),
                            frame.uv.width / 2);
  const blend::Clip rows(y, std::min({tile.u.height, tile.v.height, alpha.height}),
                         frame.uv.height);
  if (columns.count() <= 0) return;
  for (int row = rows.first; row < rows.last; ++row) {
    blend::kernels().pair(frame.uv.row(y + row) + 2 * (x + columns.first),
                          tile.u.row(row) + columns.first, tile.v.row(row) + columns.first,
                          alpha.row(row) + columns.first, columns.count());
  }
}

}  // namespace sightline
