// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/text/label_placement.hpp"

#include <algorithm>
#include <cmath>

#include "sightline/base/check.hpp"

namespace sightline::render {
namespace {

constexpr int kCornerInset = 8;
/// Between a text and the box it stands beside, or below.
constexpr int kGap = 2;
/// A better place must have this much room around it before a text returns to it [px].
constexpr int kSpare = 8;
/// So many texts may be stacked above or below one box.
constexpr int kMaxSteps = 4;

int as_int(float value) {
  return std::isfinite(value) ? static_cast<int>(std::clamp(value, -32768.0f, 32767.0f)) : 0;
}

bool intersect(const TileRect& a, const TileRect& b, int margin) {
  return a.x < b.x + b.width + margin && b.x < a.x + a.width + margin &&
         a.y < b.y + b.height + margin && b.y < a.y + a.height + margin;
}

}  // namespace

/// Places of one text, the best first; those that would reach out of the frame are empty, so that
/// a place keeps its number.
class LabelPlacement::Candidates {
 public:
  Candidates(const LabelPlacement& frame, int width, int height)
      : frame_(frame), width_(width), height_(height) {}

  /// Even if it must be moved to lie inside the frame.
  void add_usual(int x, int y) { push(frame_.inside(x, y, width_, height_)); }
  /// May slide sideways, but not up or down.
  void add_row(int x, int y) {
    const bool fits = y >= 0 && y + height_ <= frame_.frame_height_;
    push(fits ? frame_.inside(x, y, width_, height_) : TileRect{});
  }
  /// May slide up or down, but not sideways.
  void add_column(int x, int y) {
    const bool fits = x >= 0 && x + width_ <= frame_.frame_width_;
    push(fits ? frame_.inside(x, y, width_, height_) : TileRect{});
  }
  std::span<const TileRect> all() const { return {places_.data(), count_}; }

 private:
  void push(const TileRect& place) { places_[count_++] = place; }

  const LabelPlacement& frame_;
  int width_, height_;
  std::array<TileRect, 24> places_{};
  size_t count_ = 0;
};

LabelPlacement::LabelPlacement(int frame_width, int frame_height, size_t slots)
    : frame_width_(frame_width), frame_height_(frame_height), last_(slots, 0) {
  taken_.reserve(2 * slots);
  begin();
}

void LabelPlacement::begin() {
  taken_.clear();
  corner_y_ = kCornerInset;
}

TileRect LabelPlacement::corner_line(int width, int height) {
  const TileRect place = inside(kCornerInset, corner_y_, width, height);
  corner_y_ += height;
  return take(place);
}

TileRect LabelPlacement::beside(size_t slot, const Extent& extent, int width, int height) {
  const int left = as_int(extent.left), right = as_int(extent.right);
  const int top = as_int(extent.top), bottom = as_int(extent.bottom);
  const int above = top - height, below = bottom + kGap;
  Candidates places(*this, width, height);
  places.add_usual(left, above >= 0 ? above : below);
  for (const int x : {left, right - width}) {
    places.add_row(x, above);
    places.add_row(x, below);
  }
  for (const int y : {top, bottom - height}) {
    places.add_column(right + kGap, y);
    places.add_column(left - kGap - width, y);
  }
  for (int step = 1; step < kMaxSteps; ++step) {
    places.add_row(left, above - step * height);
    places.add_row(left, below + step * height);
  }
  return choose(slot, places);
}

TileRect LabelPlacement::near(size_t slot, int x, int y, int width, int height) {
  Candidates places(*this, width, height);
  places.add_usual(x, y);
  const TileRect usual = places.all().front();
  for (int step = 1; step < kMaxSteps; ++step) {
    places.add_row(usual.x, usual.y - step * height);
    places.add_row(usual.x, usual.y + step * height);
    places.add_column(usual.x - step * width, usual.y);
    places.add_column(usual.x + step * width, usual.y);
  }
  return choose(slot, places);
}

TileRect LabelPlacement::choose(size_t slot, const Candidates& candidates) {
  SL_CHECK(slot < last_.size(), "a text's slot is one of those asked for");
  const std::span<const TileRect> places = candidates.all();
  for (size_t i = 0; i < places.size(); ++i) {
    if (places[i].empty() || !free(places[i], i < last_[slot] ? kSpare : 0)) continue;
    last_[slot] = i;
    return take(places[i]);
  }
  last_[slot] = 0;
  return take(places.front());
}

TileRect LabelPlacement::take(const TileRect& rect) {
  taken_.push_back(rect);
  return rect;
}

bool LabelPlacement::free(const TileRect& rect, int spare_px) const {
  return std::ranges::none_of(
      taken_, [&](const TileRect& other) { return intersect(rect, other, spare_px); });
}

TileRect LabelPlacement::inside(int frame_width, int frame_height, int x, int y, int width,
                                int height) {
  const int right = std::max(frame_width - width, 0);
  const int bottom = std::max(frame_height - height, 0);
  return {std::clamp(x, 0, right) & ~1, std::clamp(y, 0, bottom) & ~1, width, height};
}

}  // namespace sightline::render
