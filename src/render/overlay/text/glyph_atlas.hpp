// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"

namespace sightline {

/// One character, rendered once: coverage of its strokes and of the halo around them.
struct Glyph {
  int left = 0;        ///< of the coverage, from the pen [px]
  int top = 0;         ///< of the coverage, upwards from the base line [px]
  int width = 0;       ///< of the coverage
  int height = 0;      ///< of the coverage
  int advance = 0;     ///< of the pen [px]
  size_t strokes = 0;  ///< offset of width x height bytes, in rows of row_bytes(width)
  size_t halo = 0;     ///< of (width + 2 margin) x (height + 2 margin), likewise

  /// Rows end in zeros up to a multiple of kStep, so that they are laid in whole steps.
  static constexpr int kStep = 16;
  static constexpr int row_bytes(int pixels) { return (pixels + kStep - 1) / kStep * kStep; }
};

/// The characters labels use, at one size: Latin-1 and a few symbols. Immutable once made.
class GlyphAtlas {
 public:
  static constexpr int kHaloMargin = 2;  ///< [px] on every side

  /// Reads the font (FreeType) and renders at `em_px`. An empty path means DejaVu Sans in the usual
  /// places; the error names all that were tried and the package that brings one.
  static Result<std::shared_ptr<const GlyphAtlas>> create(const std::filesystem::path& font_file,
                                                          int em_px);

  /// The glyph of a code point; a box for one the atlas does not hold.
  const Glyph& glyph(uint32_t code_point) const;
  const uint8_t* strokes(const Glyph& glyph) const { return bytes_.data() + glyph.strokes; }
  const uint8_t* halo(const Glyph& glyph) const { return bytes_.data() + glyph.halo; }

  int ascent() const { return ascent_; }            ///< [px]
  int line_height() const { return line_height_; }  ///< [px]
  int widest_advance() const { return widest_advance_; }

 private:
  struct Entry {
    uint32_t code_point;
    Glyph glyph;
  };
  class Builder;

  std::vector<Entry> entries_;  ///< growing code points
  std::vector<uint8_t> bytes_;
  Glyph missing_;
  int ascent_ = 0;
  int line_height_ = 0;
  int widest_advance_ = 0;
};

/// Takes one code point off the front of a UTF-8 text; U+FFFD for bytes that are not UTF-8
/// (overlong forms and surrogates included). The text must not be empty.
uint32_t next_code_point(std::string_view& text);

}  // namespace sightline
