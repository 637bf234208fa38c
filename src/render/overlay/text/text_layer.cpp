// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/text/text_layer.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "render/overlay/text/glyph_atlas.hpp"

namespace sightline::render {
namespace {

constexpr Yuv kWhite{235, 128, 128};
constexpr int kMaxTextCharacters = 96;
constexpr int kMaxTextLines = 3;

bool writes_text(const OverlayStyle& style) {
  return style.label || style.offscreen || style.status || style.last_seen;
}

int as_int(float value) {
  return std::isfinite(value) ? static_cast<int>(std::clamp(value, -32768.0f, 32767.0f)) : 0;
}

}  // namespace

TextLayer::TextLayer(int frame_width, int frame_height, size_t objects)
    : entries_(objects), placement_(frame_width, frame_height, objects) {}

Result<TextLayer> TextLayer::create(std::span<const OverlayStyle* const> styles,
                                    const std::filesystem::path& font_file, int frame_width,
                                    int frame_height) {
  TextLayer layer(frame_width, frame_height, styles.size());
  for (size_t i = 0; i < styles.size(); ++i) {
    const OverlayStyle& style = *styles[i];
    if (!writes_text(style)) continue;
    Entry& entry = layer.entries_[i];
    for (const auto& font : layer.fonts_) {
      if (font->em_px == style.font_px) entry.font = font.get();
    }
    if (entry.font != nullptr) continue;
    SL_ASSIGN(auto atlas, GlyphAtlas::create(font_file, style.font_px));
    layer.fonts_.push_back(std::make_unique<Font>(
        Font{style.font_px, TextTile(std::move(atlas), kMaxTextCharacters, kMaxTextLines)}));
    entry.font = layer.fonts_.back().get();
  }
  return layer;
}

void TextLayer::begin() {
  placement_.begin();
  for (Entry& entry : entries_) {
    entry.place = Place::kNone;
    entry.has_status = false;
  }
}

void TextLayer::add_beside(size_t object, const LabelText& text, const std::array<Yuv, 2>& colors,
                           const Extent& extent) {
  Entry& entry = entries_[object];
  entry.place = Place::kBeside;
  entry.text = text;
  entry.colors = colors;
  entry.extent = extent;
}

void TextLayer::add_offscreen(size_t object, const LabelText& text, const marks::Arrow& arrow,
                              float arrow_px) {
  Entry& entry = entries_[object];
  entry.place = Place::kOffscreen;
  entry.text = text;
  entry.colors = {kWhite, kWhite};
  entry.arrow = arrow;
  entry.arrow_px = arrow_px;
}

void TextLayer::add_status(size_t object, const LabelText& text) {
  entries_[object].has_status = true;
  entries_[object].status = text;
}

/// The corner's lines first: they have their place, and labels give way to them.
void TextLayer::draw(const FrameTarget& target) {
  for (Entry& entry : entries_) {
    if (!entry.has_status) continue;
    TextTile& tile = entry.font->text;
    tile.set(entry.status.view(), std::span(&kWhite, 1));
    const TileRect at = placement_.corner_line(tile.width(), tile.height());
    target.blend(tile.at(at.x, at.y));
  }
  for (size_t i = 0; i < entries_.size(); ++i) draw_entry(target, i);
}

void TextLayer::draw_entry(const FrameTarget& target, size_t object) {
  Entry& entry = entries_[object];
  if (entry.place == Place::kNone) return;
  TextTile& tile = entry.font->text;
  tile.set(entry.text.view(), entry.colors);
  TileRect at;
  if (entry.place == Place::kBeside) {
    at = placement_.beside(object, entry.extent, tile.width(), tile.height());
  } else {
    // Towards the middle of the image, clear of the arrow.
    const draw::Point half(0.5f * static_cast<float>(tile.width()),
                           0.5f * static_cast<float>(tile.height()));
    const draw::Point& direction = entry.arrow.direction;
    const float clear = 1.3f * entry.arrow_px + half.cwiseProduct(direction).norm();
    const draw::Point corner = entry.arrow.tip - clear * direction - half;
    at = placement_.near(object, as_int(corner.x()), as_int(corner.y()), tile.width(),
                         tile.height());
  }
  target.blend(tile.at(at.x, at.y));
}

}  // namespace sightline::render
