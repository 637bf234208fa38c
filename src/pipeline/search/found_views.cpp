// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/search/found_views.hpp"

#include <algorithm>
#include <utility>

namespace sightline {

void FoundViews::put(CameraId camera, FoundView view) {
  std::lock_guard lock(mutex_);
  if (camera.index() >= views_.size()) views_.resize(camera.index() + 1);
  std::vector<FoundView>& of_camera = views_[camera.index()];
  const auto same = std::find_if(of_camera.begin(), of_camera.end(),
                                 [&](const FoundView& v) { return v.object == view.object; });
  if (same == of_camera.end()) {
    of_camera.push_back(std::move(view));
    return;
  }
  std::swap(*same, view);
}

std::vector<FoundView> FoundViews::take(CameraId camera) {
  std::lock_guard lock(mutex_);
  if (camera.index() >= views_.size()) return {};
  return std::exchange(views_[camera.index()], {});
}

}  // namespace sightline
