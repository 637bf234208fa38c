// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace sightline::capture {

/// Unwraps the frame numbers of a camera to 64 bits, from 0, and finds the gaps. GigE Vision counts
/// 1..65535 and leaves 0 out, or 64 bits in extended mode; USB3 Vision has 64 bits, kernel drivers
/// and libcamera 32. One thread.
class FrameIds {
 public:
  enum class Width { k16, k32, k64 };
  struct Step {
    uint64_t sequence = 0;        ///< starts at 0
    uint32_t dropped_before = 0;  ///< frames between the previous one and this one
  };

  /// k16 turns into k64 by itself when a number above 65535 comes.
  explicit FrameIds(Width width) : width_(width) {}

  /// A number that repeats or goes back means that the camera does not count, or began anew: it
  /// counts as the next frame.
  Step step(uint64_t id);

 private:
  uint64_t forward(uint64_t id) const;

  Width width_;
  bool started_ = false;
  uint64_t last_id_ = 0;
  uint64_t sequence_ = 0;
};

}  // namespace sightline::capture
