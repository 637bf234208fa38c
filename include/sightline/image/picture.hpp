// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <vector>

#include "sightline/image/planes.hpp"

namespace sightline {

/// An I420 picture that owns its memory: planes 64-byte aligned, strides multiples of 64.
class Picture {
 public:
  Picture(int width, int height);
  Picture(const Picture&) = delete;
  Picture& operator=(const Picture&) = delete;

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

/// Recycles pictures of one size: get() allocates only while the pool warms up. A picture goes back
/// when its last reference is dropped, from any thread; the memory outlives the pool object.
class PicturePool {
 public:
  PicturePool(int width, int height, size_t keep_at_most = 16);
  std::shared_ptr<Picture> get();
  /// A picture of half the size (width/2 x height/2), recycled in the same way.
  std::shared_ptr<Picture> get_half();
  /// Pictures allocated since the start; constant once warm.
  size_t allocated() const;

 private:
  struct Shared;
  std::shared_ptr<Shared> shared_;
};

}  // namespace sightline
