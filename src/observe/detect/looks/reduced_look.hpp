// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <vector>

#include "observe/detect/pose_fit.hpp"

namespace sightline::observe {

/// One camera at a quarter of its size, for poses at which the object is large in its image: steps
/// of the search and errors of mesh and lens are so many pixels there, and print is so dense, that
/// at half size lines find other edges than their own. Made when it is first asked for.
class ReducedLook {
 public:
  /// `camera`: with half as many pixels, see reduced().
  explicit ReducedLook(CalibratedCamera camera) : calibration_(std::move(camera)) {}

  /// From now on that of this look at half size, which has to live on. Only edges where `half_mask`
  /// is 1 count, all if it is empty.
  void show(const FitCamera& half, const std::vector<uint8_t>& half_mask);
  void set_seconds(double seconds) { camera_.seconds = seconds; }
  /// While nobody changes this, any thread may ask.
  const FitCamera& camera() const;
  /// Images whose edges were found so far.
  uint64_t images() const { return images_.load(std::memory_order_relaxed); }

 private:
  void find_edges() const;

  CalibratedCamera calibration_;
  FitCamera camera_;
  const HalfSizeImage* half_image_ = nullptr;
  const ForegroundMap* half_foreground_ = nullptr;
  const std::vector<uint8_t>* half_mask_ = nullptr;  ///< null: all edges count
  mutable std::mutex mutex_;                         ///< of who finds them
  mutable std::atomic<bool> made_{false};
  mutable std::atomic<uint64_t> images_{0};
  mutable HalfSizeImage image_;
  mutable EdgeImage edges_;
  mutable ForegroundMap foreground_;
  mutable std::vector<uint8_t> mask_;
};

}  // namespace sightline::observe
