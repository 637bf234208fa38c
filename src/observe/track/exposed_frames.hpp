// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include "sightline/model/frame.hpp"

namespace sightline::observe {

/// A camera's frames as if they had been exposed well (terms/exposure.hpp). What is learned of
/// colors has to stay true from frame to frame, so the gain changes only where the light does. One
/// thread at a time.
class ExposedFrames {
 public:
  /// The frame itself, where it is bright enough; else a brighter copy: valid until the next call.
  /// Allocates nothing once warm.
  const Frame& show(const Frame& frame);
  /// A frame of before, by the gain of now.
  FramePtr show_like(const FramePtr& frame);

 private:
  FramePtr exposed(const Frame& frame);

  std::optional<Time> looked_;  // at how bright frames are
  double gain_ = 1;
  std::shared_ptr<ImagePool> pool_;
  int width_ = 0, height_ = 0;  // of its images
  FramePtr shown_;
};

}  // namespace sightline::observe
