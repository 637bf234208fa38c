// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "sightline/observe/shape/viewpoint_model.hpp"
#include "sightline/observe/terms/detection.hpp"
#include "sightline/pipeline/search/found_views.hpp"

namespace sightline::pipeline {

/// The newest frame of each camera that is searched, and what is found in them as views for the
/// trackers. One thread at a time.
class FoundFrames {
 public:
  FoundFrames(std::span<const DetectorCamera> cameras, std::shared_ptr<FoundViews> views);

  /// Copies the frame.
  void keep(CameraId camera, const Frame& frame);
  /// Offers an object where it was found in the frames that are kept; nothing where the images
  /// show several poses equally well that are not the same up to symmetry.
  void offer(const Detection& found, const ViewpointModel& model, bool refutes);

 private:
  struct Camera {
    Rigid3 camera_from_world;  ///< of one that stands still
    std::shared_ptr<ImagePool> pool;
    FramePtr newest;
  };
  std::vector<Camera> cameras_;  // by CameraId
  const std::shared_ptr<FoundViews> views_;
};

}  // namespace sightline::pipeline
