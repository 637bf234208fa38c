// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <memory>

#include "sightline/image/image.hpp"
#include "sightline/model/frame.hpp"

namespace sightline::test {

/// The frame as a shorter exposure would have shown it: luma above black and color differences
/// times `share`.
inline FramePtr dimmed(const FramePtr& frame, double share) {
  const I420View from = frame->i420();
  const auto image = std::make_shared<Image>(frame->info().width, frame->info().height);
  const auto dim = [share](const PlaneView& source, const MutablePlaneView& target, int zero) {
    for (int y = 0; y < target.height; ++y) {
      for (int x = 0; x < target.width; ++x) {
        target.row(y)[x] =
            static_cast<uint8_t>(std::lround(zero + share * (source.row(y)[x] - zero)));
      }
    }
  };
  dim(from.y, image->mutable_view().y, 16);
  dim(from.u, image->mutable_view().u, 128);
  dim(from.v, image->mutable_view().v, 128);
  return Frame::decoded(frame->info(), image);
}

}  // namespace sightline::test
