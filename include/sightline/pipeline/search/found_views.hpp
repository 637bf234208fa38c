// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mutex>
#include <vector>

#include "sightline/observe/track/found_view.hpp"

namespace sightline {

/// From a search to the cameras: the frame in which each object was found last, and where. Any
/// thread.
class FoundViews {
 public:
  /// Takes the place of an earlier view of the object in this camera.
  void put(CameraId camera, FoundView view);
  /// Takes those of a camera; mostly none.
  std::vector<FoundView> take(CameraId camera);

 private:
  std::mutex mutex_;
  std::vector<std::vector<FoundView>> views_;  // by CameraId
};

}  // namespace sightline
