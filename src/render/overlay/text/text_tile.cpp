// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/text/text_tile.hpp"

#include <algorithm>
#include <cstring>

#include "render/overlay/tile/tile_kernels.hpp"

namespace sightline {
namespace {

constexpr int kBorder = 2 * GlyphAtlas::kHaloMargin;

int even_up(int value) { return (value + 1) & ~1; }

}  // namespace

TextTile::TextTile(std::shared_ptr<const GlyphAtlas> atlas, int max_characters, int max_lines)
    : atlas_(std::move(atlas)),
      max_width_(even_up(max_characters * atlas_->widest_advance() + 2 * kBorder)),
      max_height_(even_up(max_lines * atlas_->line_height() + 2 * kBorder)) {
  const size_t pixels = static_cast<size_t>(max_width_) * static_cast<size_t>(max_height_);
  for (std::vector<uint8_t>* plane : {&strokes_, &halo_, &luma_})
    plane->resize(pixels + 2 * Glyph::kStep);
  for (std::vector<uint8_t>* plane : {&u_, &v_, &chroma_alpha_}) plane->resize(pixels / 4);
}

void TextTile::set(std::string_view text, std::span<const Yuv> colors) {
  for (int y = 0; y < height_; ++y) {
    const ptrdiff_t row = static_cast<ptrdiff_t>(y) * max_width_;
    std::memset(strokes_.data() + row, 0, static_cast<size_t>(width_));
    std::memset(halo_.data() + row, 0, static_cast<size_t>(width_));
  }
  width_ = 0;
  int top = kBorder;
  int first_row = 0;
  std::array<int, 8> ends{};
  size_t lines = 0;
  while (!text.empty() && lines < ends.size() &&
         top + atlas_->line_height() + kBorder <= max_height_) {
    const size_t end = std::min(text.find('\n'), text.size());
    set_line(text.substr(0, end), top);
    text.remove_prefix(std::min(end + 1, text.size()));
    top += atlas_->line_height();
    ends[lines++] = even_up(top + (text.empty() ? kBorder : 0));
  }
  width_ = std::min(even_up(width_), max_width_);
  height_ = lines == 0 ? 0 : std::min(ends[lines - 1], max_height_);
  for (size_t i = 0; i < lines; ++i) {
    const int last_row = std::min(ends[i], height_);
    color_rows(first_row, last_row, colors[std::min(i, colors.size() - 1)]);
    first_row = last_row;
  }
}

void TextTile::set_line(std::string_view line, int top) {
  int pen = kBorder;
  const int base = top + atlas_->ascent();
  while (!line.empty()) {
    const Glyph& glyph = atlas_->glyph(next_code_point(line));
    if (pen + std::max(glyph.advance, glyph.left + glyph.width) + kBorder > max_width_) break;
    const int x = pen + glyph.left;
    const int y = base - glyph.top;
    constexpr int kMargin = GlyphAtlas::kHaloMargin;
    if (glyph.width > 0) {
      lay(atlas_->strokes(glyph), glyph.width, glyph.height, strokes_.data(), x, y);
      lay(atlas_->halo(glyph), glyph.width + 2 * kMargin, glyph.height + 2 * kMargin, halo_.data(),
          x - kMargin, y - kMargin);
    }
    pen += glyph.advance;
    width_ = std::max({width_, pen + kBorder, x + glyph.width + kBorder});
  }
}

void TextTile::lay(const uint8_t* from, int width, int height, uint8_t* plane, int x, int y) {
  const int row_bytes = Glyph::row_bytes(width);
  const int first = std::max(0, -y), last = std::min(height, max_height_ - y);
  if (x < 0 || x + width > max_width_) return;
  // Whole steps: past the glyph there are zeros, which change nothing, and past the plane slack.
  for (int row = first; row < last; ++row) {
    uint8_t* const to = plane + static_cast<ptrdiff_t>(y + row) * max_width_ + x;
    const uint8_t* const source = from + static_cast<ptrdiff_t>(row) * row_bytes;
    for (int step = 0; step < row_bytes; step += Glyph::kStep) {
      for (int i = step; i < step + Glyph::kStep; ++i) to[i] = std::max(to[i], source[i]);
    }
  }
}

void TextTile::color_rows(int first, int last, Yuv color) {
  const tile::Kernels& kernels = tile::kernels();
  for (int y = first; y < last; ++y) {
    const ptrdiff_t row = static_cast<ptrdiff_t>(y) * max_width_;
    kernels.text_luma(strokes_.data() + row, color.y, halo_.data() + row, luma_.data() + row,
                      width_);
  }
  for (int y = first / 2; y < last / 2; ++y) {
    const ptrdiff_t top = static_cast<ptrdiff_t>(2 * y) * max_width_;
    const ptrdiff_t row = static_cast<ptrdiff_t>(y) * (max_width_ / 2);
    const tile::TextChromaIn in{{strokes_.data() + top, strokes_.data() + top + max_width_},
                                {halo_.data() + top, halo_.data() + top + max_width_},
                                color.u,
                                color.v};
    kernels.text_chroma(in, u_.data() + row, v_.data() + row, chroma_alpha_.data() + row,
                        width_ / 2);
  }
}

OverlayTileView TextTile::at(int x, int y) const {
  const auto full = [&](const std::vector<uint8_t>& plane) {
    return PlaneView{plane.data(), width_, height_, max_width_};
  };
  const auto half = [&](const std::vector<uint8_t>& plane) {
    return PlaneView{plane.data(), width_ / 2, height_ / 2, max_width_ / 2};
  };
  return {x & ~1, y & ~1, full(luma_), half(u_), half(v_), full(halo_), half(chroma_alpha_)};
}

}  // namespace sightline
