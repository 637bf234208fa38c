// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "render/overlay/frame_target.hpp"
#include "render/overlay/marks.hpp"
#include "render/overlay/text/label_placement.hpp"
#include "render/overlay/text/text_tile.hpp"
#include "sightline/base/result.hpp"
#include "sightline/render/overlay/label.hpp"

namespace sightline::render {

/// The texts of one camera's frames: gathered while objects are drawn, then placed in the order of
/// the objects, not of their distance, so that two objects that pass each other do not swap places.
/// Text lies over everything else. Nothing allocates after create().
class TextLayer {
 public:
  /// One style per object. Refused: a font that cannot be read, if a style writes text.
  static Result<TextLayer> create(std::span<const OverlayStyle* const> styles,
                                  const std::filesystem::path& font_file, int frame_width,
                                  int frame_height);

  void begin();
  /// Text of an object beside a box; lines take the colors in turn.
  void add_beside(size_t object, const LabelText& text, const std::array<Yuv, 2>& colors,
                  const Extent& extent);
  /// Text of an object outside the image, towards the image's middle from its arrow.
  void add_offscreen(size_t object, const LabelText& text, const marks::Arrow& arrow,
                     float arrow_px);
  /// A line in the corner for an object that has no pose.
  void add_status(size_t object, const LabelText& text);
  void draw(const FrameTarget& target);

 private:
  struct Font {
    int em_px;
    TextTile text;
  };
  enum class Place : uint8_t { kNone, kBeside, kOffscreen };
  struct Entry {
    Font* font = nullptr;  ///< null: writes no text
    Place place = Place::kNone;
    LabelText text;
    std::array<Yuv, 2> colors{};
    Extent extent{};
    marks::Arrow arrow{};
    float arrow_px = 0;
    bool has_status = false;
    LabelText status;
  };

  TextLayer(int frame_width, int frame_height, size_t objects);
  void draw_entry(const FrameTarget& target, size_t object);

  std::vector<std::unique_ptr<Font>> fonts_;
  std::vector<Entry> entries_;  ///< by object
  LabelPlacement placement_;
};

}  // namespace sightline::render
