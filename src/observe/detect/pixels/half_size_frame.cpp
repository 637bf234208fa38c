// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/pixels/half_size_frame.hpp"

#include <algorithm>

namespace sightline::observe {

bool has_colors(const HalfSizeImage& image) {
  constexpr int kStep = 8, kTint = 6;  // [pixels, levels] noise of compressed video is less
  for (size_t plane = 1; plane < 3; ++plane) {
    int least = 255, most = 0;
    for (int y = 0; y < image.height; y += kStep) {
      const uint8_t* row = image.row(plane, y);
      for (int x = 0; x < image.width; x += kStep) {
        least = std::min<int>(least, row[x]);
        most = std::max<int>(most, row[x]);
      }
    }
    if (most - least > kTint) return true;
  }
  return false;
}

bool HalfSizeFrame::store(const Frame& frame, const CameraModel& camera) {
  if (frame.info().status == FrameStatus::kDamaged || frame.info().width != camera.width() ||
      frame.info().height != camera.height())
    return false;
  info = frame.info();
  const PlaneView luma = frame.half_gray();
  const I420View full = frame.i420();
  image.width = luma.width;
  image.height = luma.height;
  const std::array<PlaneView, 3> from = {luma, full.u, full.v};
  const auto width = static_cast<size_t>(luma.width);
  for (size_t k = 0; k < 3; ++k) {
    std::vector<uint8_t>& to = image.planes[k];
    to.resize(width * static_cast<size_t>(luma.height));
    for (int y = 0; y < luma.height; ++y) {
      std::copy_n(from[k].row(y), luma.width, to.data() + static_cast<size_t>(y) * width);
    }
  }
  valid = true;
  return true;
}

}  // namespace sightline::observe
