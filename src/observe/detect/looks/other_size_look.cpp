// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/looks/other_size_look.hpp"

namespace sightline::observe {

void OtherSizeLook::show(const FitCamera& half, double pixel_size,
                         const std::vector<uint8_t>& half_mask) {
  calibration_.world_from_camera = half.camera->world_from_camera;
  half_ = half;
  half_mask_ = half_mask.empty() ? nullptr : &half_mask;
  camera_ = {};
  camera_.camera = &calibration_;
  camera_.camera_from_world = half.camera_from_world;
  camera_.image = &image_;
  camera_.edges = &edges_;
  camera_.seconds = half.seconds;
  camera_.foreground = half.foreground != nullptr ? &foreground_ : nullptr;
  camera_.pixel_size = pixel_size;
  made_ = false;
}

const FitCamera& OtherSizeLook::made() const {
  if (!made_.load(std::memory_order_acquire)) {
    const std::lock_guard lock(mutex_);
    if (!made_.load(std::memory_order_relaxed)) {
      make(image_, edges_);
      images_.fetch_add(1, std::memory_order_relaxed);
      made_.store(true, std::memory_order_release);
    }
  }
  return camera_;
}

}  // namespace sightline::observe
