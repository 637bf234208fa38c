// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstring>
#include <utility>
#include <vector>

#include "sightline/image/image.hpp"

namespace sightline::test {

/// An I420 image of one gray.
class GrayImage : public Image {
 public:
  GrayImage(int width, int height, int luma) : Image(width, height) { clear(luma); }
  void clear(int luma) {
    fill(mutable_view().y, luma);
    fill(mutable_view().u, 128);
    fill(mutable_view().v, 128);
  }
  static void fill(const MutablePlaneView& plane, int value) {
    for (int y = 0; y < plane.height; ++y) {
      std::memset(plane.row(y), value, static_cast<size_t>(plane.width));
    }
  }
};

/// An NV12 image of one gray.
class Nv12Image {
 public:
  Nv12Image(int width, int height, int luma)
      : width_(width),
        height_(height),
        luma_(static_cast<size_t>(width) * static_cast<size_t>(height), static_cast<uint8_t>(luma)),
        chroma_(2 * static_cast<size_t>((width + 1) / 2) * static_cast<size_t>((height + 1) / 2),
                uint8_t{128}) {}
  MutableNv12View mutable_view() {
    const int chroma_bytes = 2 * ((width_ + 1) / 2);
    return {{luma_.data(), width_, height_, width_},
            {chroma_.data(), chroma_bytes, (height_ + 1) / 2, chroma_bytes}};
  }
  Nv12View view() const {
    const int chroma_bytes = 2 * ((width_ + 1) / 2);
    return {{luma_.data(), width_, height_, width_},
            {chroma_.data(), chroma_bytes, (height_ + 1) / 2, chroma_bytes}};
  }

 private:
  int width_, height_;
  std::vector<uint8_t> luma_, chroma_;
};

template <typename Visit>
void for_each_luma(const I420View& view, Visit visit) {
  for (int y = 0; y < view.height(); ++y) {
    for (int x = 0; x < view.width(); ++x) visit(x, y, int{view.y.row(y)[x]});
  }
}

/// Pixels whose luma is not `background`.
inline std::vector<std::pair<int, int>> differing_luma(const I420View& view, int background) {
  std::vector<std::pair<int, int>> result;
  for_each_luma(view, [&](int x, int y, int luma) {
    if (luma != background) result.emplace_back(x, y);
  });
  return result;
}

inline bool same_plane(const PlaneView& a, const PlaneView& b) {
  if (a.width != b.width || a.height != b.height) return false;
  for (int y = 0; y < a.height; ++y) {
    if (std::memcmp(a.row(y), b.row(y), static_cast<size_t>(a.width)) != 0) return false;
  }
  return true;
}

inline bool same_pixels(const I420View& a, const I420View& b) {
  return same_plane(a.y, b.y) && same_plane(a.u, b.u) && same_plane(a.v, b.v);
}

inline bool same_pixels(const I420View& a, const Nv12View& b) {
  if (!same_plane(a.y, b.y)) return false;
  for (int y = 0; y < a.u.height; ++y) {
    for (int x = 0; x < a.u.width; ++x) {
      const uint8_t* pair = b.uv.row(y) + 2 * x;
      if (a.u.row(y)[x] != pair[0] || a.v.row(y)[x] != pair[1]) return false;
    }
  }
  return true;
}

}  // namespace sightline::test
