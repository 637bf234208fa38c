// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/text/glyph_atlas.hpp"

#include <ft2build.h>
#include FT_FREETYPE_H

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <system_error>

namespace sightline {
namespace {

constexpr std::array<const char*, 3> kUsualFonts = {
    "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf",
    "/usr/share/fonts/TTF/DejaVuSans.ttf",
    "/usr/share/fonts/dejavu-sans-fonts/DejaVuSans.ttf",
};

constexpr std::array<uint32_t, 14> kSymbols = {0x2026, 0x2013, 0x2014, 0x2190, 0x2191,
                                               0x2192, 0x2193, 0x221E, 0x2248, 0x2264,
                                               0x2265, 0x03BC, 0x03C3, 0xFFFD};

struct FreeLibrary {
  void operator()(FT_Library library) const { FT_Done_FreeType(library); }
};
struct FreeFace {
  void operator()(FT_Face face) const { FT_Done_Face(face); }
};
using LibraryPtr = std::unique_ptr<std::remove_pointer_t<FT_Library>, FreeLibrary>;
using FacePtr = std::unique_ptr<std::remove_pointer_t<FT_Face>, FreeFace>;

Result<std::filesystem::path> find_font(const std::filesystem::path& requested) {
  std::error_code ignored;
  if (!requested.empty()) {
    if (std::filesystem::is_regular_file(requested, ignored)) return requested;
    return make_error(ErrorCode::kNotFound, requested.string(),
                      "no such font file; leave the font out to use DejaVu Sans (Debian package "
                      "fonts-dejavu-core)");
  }
  std::string tried;
  for (const char* path : kUsualFonts) {
    if (std::filesystem::is_regular_file(path, ignored)) return std::filesystem::path(path);
    tried += tried.empty() ? path : std::string(", ") + path;
  }
  return make_error(ErrorCode::kUnavailable, "overlay font",
                    "DejaVu Sans not found (looked at {}); install the package fonts-dejavu-core "
                    "or name a font file",
                    tried);
}

int from_26_6(FT_Pos value) { return static_cast<int>((value + 32) >> 6); }

bool is_continuation(char c) { return (static_cast<uint8_t>(c) & 0xC0u) == 0x80u; }

}  // namespace

/// Renders glyph by glyph into an atlas.
class GlyphAtlas::Builder {
 public:
  Builder(FT_Face face, GlyphAtlas& atlas) : face_(face), atlas_(atlas) {}

  void add(uint32_t code_point) {
    const FT_UInt index = FT_Get_Char_Index(face_, code_point);
    if (index == 0) return;
    Glyph glyph;
    if (render(index, glyph)) atlas_.entries_.push_back({code_point, glyph});
  }

  /// What stands for characters that are not here: the font's own box.
  void add_missing() {
    if (!render(0, atlas_.missing_)) atlas_.missing_.advance = atlas_.line_height_ / 2;
  }

 private:
  bool render(FT_UInt index, Glyph& glyph) {
    if (FT_Load_Glyph(face_, index, FT_LOAD_RENDER | FT_LOAD_TARGET_LIGHT) != 0) return false;
    const FT_GlyphSlot slot = face_->glyph;
    const FT_Bitmap& bitmap = slot->bitmap;
    if (bitmap.rows > 0 && bitmap.pixel_mode != FT_PIXEL_MODE_GRAY) return false;
    glyph.left = slot->bitmap_left;
    glyph.top = slot->bitmap_top;
    glyph.width = static_cast<int>(bitmap.width);
    glyph.height = static_cast<int>(bitmap.rows);
    glyph.advance = from_26_6(slot->advance.x);
    atlas_.widest_advance_ =
        std::max({atlas_.widest_advance_, glyph.advance, glyph.left + glyph.width});
    glyph.strokes = atlas_.bytes_.size();
    for (int y = 0; y < glyph.height; ++y) {
      const uint8_t* row = bitmap.buffer + y * bitmap.pitch;
      atlas_.bytes_.insert(atlas_.bytes_.end(), row, row + glyph.width);
      end_row(glyph.width);
    }
    add_halo(glyph);
    return true;
  }

  /// The strokes grown by a round brush: full within 1 px, fading out at the margin.
  void add_halo(Glyph& glyph) {
    const int width = glyph.width + 2 * kHaloMargin;
    const int height = glyph.height + 2 * kHaloMargin;
    glyph.halo = atlas_.bytes_.size();
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        atlas_.bytes_.push_back(halo_at(glyph, x - kHaloMargin, y - kHaloMargin));
      }
      end_row(width);
    }
  }

  void end_row(int width) {
    atlas_.bytes_.resize(atlas_.bytes_.size() +
                         static_cast<size_t>(Glyph::row_bytes(width) - width));
  }

  uint8_t halo_at(const Glyph& glyph, int x, int y) const {
    float max = 0;
    for (int dy = -kHaloMargin; dy <= kHaloMargin; ++dy) {
      for (int dx = -kHaloMargin; dx <= kHaloMargin; ++dx) {
        const int sx = x + dx;
        const int sy = y + dy;
        if (sx < 0 || sy < 0 || sx >= glyph.width || sy >= glyph.height) continue;
        const float reach = std::sqrt(static_cast<float>(dx * dx + dy * dy));
        const float weight = std::clamp(2.4f - reach, 0.0f, 1.0f);
        const size_t at =
            glyph.strokes + static_cast<size_t>(sy * Glyph::row_bytes(glyph.width) + sx);
        max = std::max(max, weight * static_cast<float>(atlas_.bytes_[at]));
      }
    }
    return static_cast<uint8_t>(0.8f * max + 0.5f);
  }

  FT_Face face_;
  GlyphAtlas& atlas_;
};

Result<std::shared_ptr<const GlyphAtlas>> GlyphAtlas::create(const std::filesystem::path& font_file,
                                                             int em_px) {
  SL_ASSIGN(const std::filesystem::path path, find_font(font_file));
  FT_Library raw_library = nullptr;
  if (FT_Init_FreeType(&raw_library) != 0) {
    return make_error(ErrorCode::kInternal, "overlay font", "FreeType does not start");
  }
  const LibraryPtr library(raw_library);
  FT_Face raw_face = nullptr;
  if (const FT_Error code = FT_New_Face(library.get(), path.c_str(), 0, &raw_face); code != 0) {
    return make_error(ErrorCode::kInvalidInput, path.string(),
                      "FreeType cannot read this font (error {}); name a TrueType or OpenType file",
                      code);
  }
  const FacePtr face(raw_face);
  if (const FT_Error code = FT_Set_Pixel_Sizes(face.get(), 0, static_cast<FT_UInt>(em_px));
      code != 0) {
    return make_error(ErrorCode::kInvalidInput, path.string(),
                      "the font has no size of {} px (FreeType error {}); use a scalable font",
                      em_px, code);
  }
  auto atlas = std::make_shared<GlyphAtlas>();
  atlas->ascent_ = from_26_6(face->size->metrics.ascender);
  atlas->line_height_ = from_26_6(face->size->metrics.height);
  Builder builder(face.get(), *atlas);
  builder.add_missing();
  for (uint32_t code_point = 0x20; code_point <= 0xFF; ++code_point) {
    if (code_point < 0x7F || code_point >= 0xA0) builder.add(code_point);
  }
  for (const uint32_t code_point : kSymbols) builder.add(code_point);
  std::ranges::sort(atlas->entries_, {}, &Entry::code_point);
  return std::shared_ptr<const GlyphAtlas>(std::move(atlas));
}

const Glyph& GlyphAtlas::glyph(uint32_t code_point) const {
  const auto found = std::ranges::lower_bound(entries_, code_point, {}, &Entry::code_point);
  return found != entries_.end() && found->code_point == code_point ? found->glyph : missing_;
}

uint32_t next_code_point(std::string_view& text) {
  constexpr uint32_t kReplacement = 0xFFFD;
  const auto lead = static_cast<uint8_t>(text.front());
  text.remove_prefix(1);
  if (lead < 0x80) return lead;
  const size_t extra = lead >= 0xF0 ? 3 : lead >= 0xE0 ? 2 : 1;
  if (lead < 0xC2 || lead > 0xF4 || text.size() < extra) return kReplacement;
  uint32_t value = lead & (0x3Fu >> extra);
  for (size_t i = 0; i < extra; ++i) {
    if (!is_continuation(text[i])) return kReplacement;
    value = (value << 6) | (static_cast<uint8_t>(text[i]) & 0x3Fu);
  }
  constexpr std::array<uint32_t, 4> kSmallest = {0, 0x80, 0x800, 0x10000};
  if (value < kSmallest[extra] || value > 0x10FFFF || (value >= 0xD800 && value <= 0xDFFF)) {
    return kReplacement;
  }
  text.remove_prefix(extra);
  return value;
}

}  // namespace sightline
