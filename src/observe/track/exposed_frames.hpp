// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "observe/terms/exposure.hpp"
#include "sightline/model/frame.hpp"

namespace sightline::observe {

/// A camera's frames, all of one size, as if they had been exposed well (terms/exposure.hpp). One
/// thread at a time.
class ExposedFrames {
 public:
  ExposedFrames(int width, int height);
  /// The frame itself, where it is bright enough; else a brighter copy: valid until the next call.
  /// Allocates nothing once warm.
  const Frame& show(const Frame& frame);
  /// A frame of before, by the gain of now.
  FramePtr show_like(const FramePtr& frame);

 private:
  FramePtr exposed(const Frame& frame);

  ExposureGain exposure_;
  double gain_ = 1;  // of now
  std::shared_ptr<ImagePool> pool_;
  FramePtr shown_;
};

}  // namespace sightline::observe
