// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <vector>

#include "observe/detect/pose_fit.hpp"

namespace sightline::observe {

/// One camera at another size than half, for poses at which the object is not of the size that
/// lines and contours are looked at. Image and edges are made when they are first asked for.
class OtherSizeLook {
 public:
  void set_seconds(double seconds) { camera_.seconds = seconds; }
  /// Images whose edges were found so far.
  uint64_t images() const { return images_.load(std::memory_order_relaxed); }

 protected:
  /// `camera`: what it shows at half size is the image of this size.
  explicit OtherSizeLook(CalibratedCamera camera) : calibration_(std::move(camera)) {}
  ~OtherSizeLook() = default;

  /// From now on that of this look at half size; only edges where `half_mask` is 1 count, all if it
  /// is empty. Both have to live on. `pixel_size`: see FitCamera.
  void show(const FitCamera& half, double pixel_size, const std::vector<uint8_t>& half_mask);
  /// With image and edges. While nobody changes this, any thread may ask.
  const FitCamera& made() const;
  /// Makes the image, and finds its edges, those that count; and what is foreground, if `half`
  /// knows.
  virtual void make(HalfSizeImage& image, EdgeImage& edges) const = 0;

  FitCamera half_;
  const std::vector<uint8_t>* half_mask_ = nullptr;  ///< null: all edges count
  mutable ForegroundMap foreground_;
  mutable std::vector<uint8_t> mask_;  ///< for make()

 private:
  CalibratedCamera calibration_;
  FitCamera camera_;
  mutable std::mutex mutex_;  ///< of who makes them
  mutable std::atomic<bool> made_{false};
  mutable std::atomic<uint64_t> images_{0};
  mutable HalfSizeImage image_;
  mutable EdgeImage edges_;
};

}  // namespace sightline::observe
