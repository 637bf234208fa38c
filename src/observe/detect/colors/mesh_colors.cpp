// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/colors/mesh_colors.hpp"

#include <algorithm>

namespace sightline::observe {

MeshColors::MeshColors(const TemplateBank& bank, const ColorTemplates& templates,
                       std::span<const SearchCamera> cameras,
                       std::span<const HalfSizeImage* const> images, const Executor& executor)
    : bank_(bank), templates_(templates), cameras_(cameras), maps_(images.size()) {
  executor(images.size(), [&](size_t i) { maps_[i].compute(*images[i]); });
}

double MeshColors::agreement(const Rigid3& world_from_object) const {
  double sum = 0, worst = 1;
  int cameras = 0;
  for (size_t i = 0; i < cameras_.size(); ++i) {
    const SearchCamera& camera = cameras_[i];
    const auto flat = bank_.weak_perspective(
        camera.camera->model, camera.camera_from_world * world_from_object, camera.shrink);
    if (!flat || flat->x < 0 || flat->y < 0 || flat->x >= static_cast<float>(maps_[i].width()) ||
        flat->y >= static_cast<float>(maps_[i].height()))
      continue;
    const auto here = static_cast<double>(templates_.correlation(*flat, maps_[i]));
    sum += here;
    worst = std::min(worst, here);
    ++cameras;
  }
  if (cameras > 2) {
    sum -= worst;
    --cameras;
  }
  return cameras > 0 ? sum / cameras : 0;
}

}  // namespace sightline::observe
