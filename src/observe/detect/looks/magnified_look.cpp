// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/looks/magnified_look.hpp"

#include <algorithm>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/pixels/foreground_masks.hpp"

namespace sightline::observe {

void MagnifiedLook::show(const FitCamera& half, const HalfSizeFrame& frame,
                         const std::vector<uint8_t>& half_mask) {
  calibration_.world_from_camera = half.camera->world_from_camera;
  frame_ = &frame;
  half_foreground_ = half.foreground;
  half_mask_ = half_mask.empty() ? nullptr : &half_mask;
  box_ = {0, 0, frame.info.width, frame.info.height};
  camera_ = {};
  camera_.camera = &calibration_;
  camera_.camera_from_world = half.camera_from_world;
  camera_.image = &image_;
  camera_.edges = &edges_;
  camera_.seconds = half.seconds;
  camera_.foreground = half_foreground_ != nullptr ? &foreground_ : nullptr;
  camera_.pixel_size = half.pixel_size / 2;
  made_ = false;
}

void MagnifiedLook::set_box(const PixelBox& box) {
  box_ = {std::max(box_.left, box.left), std::max(box_.top, box.top),
          std::min(box_.right, box.right), std::min(box_.bottom, box.bottom)};
  if (box_.right <= box_.left || box_.bottom <= box_.top) box_ = {};
}

const FitCamera* MagnifiedLook::camera() const {
  if (!made_.load(std::memory_order_acquire)) {
    const std::lock_guard lock(mutex_);
    if (!made_.load(std::memory_order_relaxed)) {
      find_edges();
      made_.store(true, std::memory_order_release);
    }
  }
  // Noise, or fine texture everywhere, has raised it.
  return edges_.threshold() > kMinGradient ? nullptr : &camera_;
}

void MagnifiedLook::find_edges() const {
  frame_->magnify(image_, box_);
  edges_.compute(image_, box_);
  images_.fetch_add(1, std::memory_order_relaxed);
  if (half_foreground_ != nullptr) {
    magnify(*half_foreground_, image_.width, image_.height, foreground_);
  }
  if (half_mask_ == nullptr) return;
  magnify(*half_mask_, frame_->image.width, frame_->image.height, image_.width, image_.height,
          mask_);
  edges_.keep_where(mask_);
}

}  // namespace sightline::observe
