// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/looks/reduced_look.hpp"

#include "observe/detect/pixels/foreground_masks.hpp"

namespace sightline::observe {

void ReducedLook::show(const FitCamera& half, const std::vector<uint8_t>& half_mask) {
  calibration_.world_from_camera = half.camera->world_from_camera;
  half_image_ = half.image;
  half_foreground_ = half.foreground;
  half_mask_ = half_mask.empty() ? nullptr : &half_mask;
  camera_ = {};
  camera_.camera = &calibration_;
  camera_.camera_from_world = half.camera_from_world;
  camera_.image = &image_;
  camera_.edges = &edges_;
  camera_.seconds = half.seconds;
  camera_.foreground = half_foreground_ != nullptr ? &foreground_ : nullptr;
  camera_.pixel_size = 2 * half.pixel_size;
  made_ = false;
}

const FitCamera& ReducedLook::camera() const {
  if (!made_.load(std::memory_order_acquire)) {
    const std::lock_guard lock(mutex_);
    if (!made_.load(std::memory_order_relaxed)) {
      find_edges();
      made_.store(true, std::memory_order_release);
    }
  }
  return camera_;
}

void ReducedLook::find_edges() const {
  reduce(*half_image_, image_);
  edges_.compute(image_);
  images_.fetch_add(1, std::memory_order_relaxed);
  if (half_foreground_ != nullptr) reduce(*half_foreground_, foreground_);
  if (half_mask_ == nullptr) return;
  reduce(*half_mask_, half_image_->width, half_image_->height, mask_);
  edges_.keep_where(mask_);
}

}  // namespace sightline::observe
