// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/overlay/marks.hpp"
#include "sightline/render/overlay/camera_renderer.hpp"

namespace sightline::render {

/// One object in one frame: what its drawing needs to know.
struct Subject {
  size_t index;  ///< of the object, as the renderer was given them
  const OverlayObject* object;
  const RenderMesh* mesh;  ///< the level of detail that is drawn
  const PoseEstimate* estimate;
  const PoseTrack* track;
  Rigid3 camera_from_object;
  Eigen::Vector3d center;  ///< of the bounding sphere, camera frame
  marks::LineStyle line_style;
  float occlusion_factor;  ///< the scene hides what has 1/z smaller by this factor

  const OverlayStyle& style() const { return object->style; }
};

}  // namespace sightline::render
