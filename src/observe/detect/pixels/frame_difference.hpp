// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "observe/detect/pixels/half_size_frame.hpp"
#include "sightline/base/time.hpp"

namespace sightline::observe {

/// What moves before a camera that stands still (frame differencing): the pixels of its half-size
/// image that are other than some tenths of a second before. An object that moves is among them,
/// most of the clutter is not. One thread at a time.
class FrameDifference {
 public:
  /// `image`, that of the newest frame so far, is going to be overwritten. It is taken, and what
  /// the caller gets for it means nothing.
  void remember(HalfSizeImage& image, Time capture);

  /// 1 for every pixel of `now` so near to a change that edges of what moves are there. False, and
  /// `mask` is empty: hardly anything has changed, or most of the image (a lamp, a camera that is
  /// carried), or there is nothing to compare with.
  bool find(const HalfSizeImage& now, Time capture, std::vector<uint8_t>& mask) const;

 private:
  struct Remembered {
    HalfSizeImage image;
    Time capture{};
  };
  const Remembered& reference(Time capture) const;

  Remembered older_, newer_;
};

}  // namespace sightline::observe
