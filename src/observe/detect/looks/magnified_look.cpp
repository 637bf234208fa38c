// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/looks/magnified_look.hpp"

#include <algorithm>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/pixels/foreground_masks.hpp"

namespace sightline::observe {

void MagnifiedLook::show(const FitCamera& half, const HalfSizeFrame& frame,
                         const std::vector<uint8_t>& half_mask) {
  OtherSizeLook::show(half, 1, half_mask);
  frame_ = &frame;
  box_ = {0, 0, frame.width, frame.height};
}

void MagnifiedLook::set_box(const PixelBox& box) {
  box_ = {std::max(box_.left, box.left), std::max(box_.top, box.top),
          std::min(box_.right, box.right), std::min(box_.bottom, box.bottom)};
  if (box_.right <= box_.left || box_.bottom <= box_.top) box_ = {};
}

const FitCamera* MagnifiedLook::camera() const {
  const FitCamera& camera = made();
  // Noise, or fine texture everywhere, has raised it.
  return camera.edges->threshold() > kMinGradient ? nullptr : &camera;
}

void MagnifiedLook::make(HalfSizeImage& image, EdgeImage& edges) const {
  frame_->magnify(image, box_);
  edges.compute(image, box_);
  if (half_.foreground != nullptr) {
    magnify(*half_.foreground, image.width, image.height, foreground_);
  }
  if (half_mask_ == nullptr) return;
  magnify(*half_mask_, half_.image->width, half_.image->height, image.width, image.height, mask_);
  edges.keep_where(mask_);
}

}  // namespace sightline::observe
