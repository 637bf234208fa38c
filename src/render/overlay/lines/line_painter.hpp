// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "render/overlay/frame_target.hpp"
#include "render/overlay/occluders.hpp"
#include "render/overlay/subject.hpp"
#include "render/overlay/surface_painter.hpp"

namespace sightline::render {

/// The lines of an object that follow its shape: wireframe, box, axes, cross and ellipse at its
/// center. Keeps its memory between frames.
class LinePainter {
 public:
  /// `camera` outlives it.
  LinePainter(const CalibratedCamera& camera, std::shared_ptr<const RayTable> rays);

  /// `surface` drew the object just before, if it is needed by its style.
  void draw(const FrameTarget& target, const Subject& subject, const SurfacePainter& surface,
            const Occluders& occluders);

 private:
  void draw_wireframe(const FrameTarget& target, const Subject& subject,
                      const SurfacePainter& surface);
  void add_seen_edge(const EdgeSegment& edge, const TileCompositor& compositor);
  void draw_axes(const FrameTarget& target, const Subject& subject, const RasterTile* occluders);
  void draw_center(const FrameTarget& target, const Subject& subject);

  const CalibratedCamera& camera_;
  const std::shared_ptr<const RayTable> rays_;
  std::vector<EdgeSegment> edges_;
  marks::Pieces pieces_;
  marks::Points points_;
};

}  // namespace sightline::render
