// SPDX-License-Identifier: Apache-2.0
#include "print_camera.hpp"

namespace sightline::test {

FramePtr noisy_frame(uint32_t camera, uint64_t sequence, const CameraModel& lens,
                     const std::vector<uint8_t>& levels, Time at, Random& random) {
  FrameInfo info;
  info.camera = CameraId(camera);
  info.sequence = sequence;
  info.capture = info.arrival = at;
  info.width = lens.width();
  info.height = lens.height();
  auto image = std::make_shared<Image>(info.width, info.height);
  const MutableI420View view = image->mutable_view();
  for (int y = 0; y < info.height; ++y) {
    uint8_t* row = view.y.row(y);
    for (int x = 0; x < info.width; ++x) {
      const uint64_t bits = random.bits();  // a sum of four: nearly normal, sigma 1.8
      const int noise = static_cast<int>((bits & 3) + (bits >> 8 & 3) + (bits >> 16 & 3)) - 4;
      const int level =
          levels[static_cast<size_t>(y) * static_cast<size_t>(info.width) + static_cast<size_t>(x)];
      row[x] = static_cast<uint8_t>(std::clamp(level + noise, 0, 255));
    }
  }
  for (const MutablePlaneView& plane : {view.u, view.v}) {
    for (int y = 0; y < plane.height; ++y) std::fill_n(plane.row(y), plane.width, 128);
  }
  return Frame::decoded(info, std::move(image));
}

}  // namespace sightline::test
