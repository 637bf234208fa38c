// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>

#include "sightline/base/recycling_pool.hpp"
#include "sightline/image/planes.hpp"

namespace sightline {

/// An I420 image that owns its memory: planes 64-byte aligned, strides multiples of 64.
class Image {
 public:
  Image(int width, int height);
  Image(const Image&) = delete;
  Image& operator=(const Image&) = delete;

  int width() const { return view_.y.width; }
  int height() const { return view_.y.height; }
  I420View view() const { return as_const(view_); }
  MutableI420View mutable_view() { return view_; }

 private:
  struct Free {
    void operator()(uint8_t* p) const;
  };
  std::unique_ptr<uint8_t, Free> memory_;
  MutableI420View view_;
};

/// Recycles images of one size: get() allocates only while the pool warms up. An image goes back
/// when its last reference is dropped, from any thread; the memory outlives the pool object.
class ImagePool {
 public:
  ImagePool(int width, int height, size_t keep_at_most = 16);
  std::shared_ptr<Image> get();
  /// An image of half the size (width/2 x height/2), recycled in the same way.
  std::shared_ptr<Image> get_half();
  /// Images allocated since the start; constant once warm.
  size_t allocated() const { return full_.allocated() + half_.allocated(); }

 private:
  int width_, height_;
  RecyclingPool<Image> full_, half_;
};

}  // namespace sightline
