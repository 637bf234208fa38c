// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "render/overlay/text/glyph_atlas.hpp"
#include "sightline/image/blend.hpp"
#include "sightline/render/overlay/overlay_style.hpp"

namespace sightline {

/// Sets text with a dark halo into a tile for blend_tile. Memory is taken once, for the longest
/// text; what does not fit is left out. Used by one thread.
class TextTile {
 public:
  TextTile(std::shared_ptr<const GlyphAtlas> atlas, int max_characters, int max_lines);

  /// Sets `text` (UTF-8, lines split at '\n'); line i takes colors[min(i, last)].
  void set(std::string_view text, std::span<const Yuv> colors);

  int width() const { return width_; }    ///< of the text set last, even [px]
  int height() const { return height_; }  ///< even [px]

  /// The tile with its corner at (x, y), made even.
  OverlayTileView at(int x, int y) const;

 private:
  void set_line(std::string_view line, int top);
  void lay(const uint8_t* from, int width, int height, uint8_t* plane, int x, int y);
  void color_rows(int first, int last, Yuv color);

  std::shared_ptr<const GlyphAtlas> atlas_;
  int max_width_, max_height_;
  int width_ = 0, height_ = 0;
  std::vector<uint8_t> strokes_, halo_;  ///< coverage; halo_ becomes the alpha
  std::vector<uint8_t> luma_, u_, v_, chroma_alpha_;
};

}  // namespace sightline
