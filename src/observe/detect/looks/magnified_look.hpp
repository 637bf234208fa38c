// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <vector>

#include "observe/detect/pose_fit.hpp"

namespace sightline::observe {

/// One camera at full size, for poses at which the object is small in its image. Its edges are
/// found when it is first asked for: what is large and followed does without.
class MagnifiedLook {
 public:
  /// `camera`: with twice as many pixels, see magnified().
  explicit MagnifiedLook(CalibratedCamera camera) : calibration_(std::move(camera)) {}

  /// From now on that of this frame, which keeps its full luma. `half` is the same camera at half
  /// size; only edges where `half_mask` is 1 count, all if it is empty. It has to live on.
  void show(const FitCamera& half, const HalfSizeFrame& frame,
            const std::vector<uint8_t>& half_mask);
  /// Nothing outside of this part of its image is asked for. Before it is asked for anything.
  void set_box(const PixelBox& box);
  void set_seconds(double seconds) { camera_.seconds = seconds; }
  /// Null: too noisy; at half size the noise is less. While nobody changes this, any thread may
  /// ask.
  const FitCamera* camera() const;
  /// Images whose edges were found so far.
  uint64_t images() const { return images_.load(std::memory_order_relaxed); }

 private:
  void find_edges() const;

  CalibratedCamera calibration_;
  FitCamera camera_;
  const HalfSizeFrame* frame_ = nullptr;
  const ForegroundMap* half_foreground_ = nullptr;
  const std::vector<uint8_t>* half_mask_ = nullptr;  ///< null: all edges count
  PixelBox box_;
  mutable std::mutex mutex_;  ///< of who finds them
  mutable std::atomic<bool> made_{false};
  mutable std::atomic<uint64_t> images_{0};
  mutable HalfSizeImage image_;
  mutable EdgeImage edges_;
  mutable ForegroundMap foreground_;
  mutable std::vector<uint8_t> mask_;
};

}  // namespace sightline::observe
