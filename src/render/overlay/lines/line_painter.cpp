// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/lines/line_painter.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace sightline::render {

LinePainter::LinePainter(const CalibratedCamera& camera, std::shared_ptr<const RayTable> rays)
    : camera_(camera), rays_(std::move(rays)) {
  pieces_.segments.reserve(1024);
  pieces_.flags.reserve(1024);
  points_.reserve(256);
}

void LinePainter::draw(const FrameTarget& target, const Subject& subject,
                       const SurfacePainter& surface, const Occluders& occluders) {
  const OverlayStyle& style = subject.style();
  const RenderMesh& mesh = *subject.object->mesh;
  if (style.wireframe && !surface.tile().rect().empty()) draw_wireframe(target, subject, surface);
  if (style.box3d) {
    pieces_.clear();
    marks::add_box(*rays_, occluders.lines(), subject.occlusion_factor, subject.camera_from_object,
                   mesh.min_corner.cast<double>(), mesh.max_corner.cast<double>(), pieces_);
    marks::draw_with_halo(target.canvas, pieces_, subject.line_style, points_);
  }
  if (style.axes) draw_axes(target, subject, occluders.lines());
  if (style.ellipse || style.cross) draw_center(target, subject);
}

void LinePainter::draw_center(const FrameTarget& target, const Subject& subject) {
  const OverlayStyle& style = subject.style();
  const auto pixel = camera_.model.project(subject.center);
  if (!pixel) return;
  const draw::Point center = pixel->cast<float>();
  if (style.ellipse) {
    const auto spread = marks::pixel_covariance(camera_.model, subject.camera_from_object,
                                                subject.estimate->pose_covariance(),
                                                subject.object->mesh->center.cast<double>());
    if (spread) {
      marks::draw_ellipse(target.canvas, center, *spread, style.ellipse_sigmas, subject.line_style,
                          points_);
    }
  }
  if (style.cross) marks::draw_cross(target.canvas, center, 8, subject.line_style);
}

/// Feature edges; those that the object itself hides are left out or dashed.
void LinePainter::draw_wireframe(const FrameTarget& target, const Subject& subject,
                                 const SurfacePainter& surface) {
  edges_.clear();
  visible_edges(*rays_, *subject.mesh, subject.camera_from_object, surface.tile(), edges_);
  pieces_.clear();
  for (const EdgeSegment& edge : edges_) {
    if (edge.visible) {
      add_seen_edge(edge, surface.compositor());
    } else if (subject.style().hidden_lines) {
      pieces_.segments.push_back(edge);
      pieces_.flags.push_back(uint8_t{marks::kTurnedAway});
    }
  }
  marks::draw_pieces(target.canvas, pieces_, subject.line_style, false, points_);
}

/// Cut into short pieces where the scene hides some of the object, to find where it begins.
void LinePainter::add_seen_edge(const EdgeSegment& edge, const TileCompositor& compositor) {
  constexpr float kPiece = 3;
  const float length = std::hypot(edge.x1 - edge.x0, edge.y1 - edge.y0);
  const int count = compositor.any_hidden() ? static_cast<int>(length / kPiece) + 1 : 1;
  EdgeSegment piece = edge;
  for (int i = 1; i <= count; ++i) {
    const float share = static_cast<float>(i) / static_cast<float>(count);
    piece.x1 = i == count ? edge.x1 : edge.x0 + share * (edge.x1 - edge.x0);
    piece.y1 = i == count ? edge.y1 : edge.y0 + share * (edge.y1 - edge.y0);
    const bool behind =
        compositor.hidden_near(static_cast<int>(std::lround(0.5f * (piece.x0 + piece.x1))),
                               static_cast<int>(std::lround(0.5f * (piece.y0 + piece.y1))));
    pieces_.segments.push_back(piece);
    pieces_.flags.push_back(behind ? uint8_t{marks::kBehindScene} : uint8_t{0});
    piece.x0 = piece.x1;
    piece.y0 = piece.y1;
  }
}

/// Far tips first, so that the nearer axis lies on top.
void LinePainter::draw_axes(const FrameTarget& target, const Subject& subject,
                            const RasterTile* occluders) {
  const std::array<Yuv, 3> hues = {to_yuv({255, 60, 60}), to_yuv({60, 230, 60}),
                                   to_yuv({80, 130, 255})};
  const double length = 0.9 * static_cast<double>(subject.object->mesh->radius);
  const Eigen::Vector3d origin = subject.camera_from_object.translation;
  std::array<int, 3> order = {0, 1, 2};
  const auto tip = [&](int axis) -> Eigen::Vector3d {
    return subject.camera_from_object * (length * Eigen::Vector3d::Unit(axis));
  };
  std::ranges::sort(order, [&](int a, int b) { return tip(a).z() > tip(b).z(); });
  for (const int axis : order) {
    pieces_.clear();
    marks::add_line(*rays_, occluders, subject.occlusion_factor, origin, tip(axis), 0, 0, pieces_);
    marks::LineStyle line_style = subject.line_style;
    line_style.color = line_style.xray_color = hues[static_cast<size_t>(axis)];
    marks::draw_with_halo(target.canvas, pieces_, line_style, points_);
  }
}

}  // namespace sightline::render
