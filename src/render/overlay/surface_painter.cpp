// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/surface_painter.hpp"

#include <utility>

#include "sightline/base/check.hpp"

namespace sightline::render {
namespace {

bool shows_texture(const Subject& subject) {
  const OverlayStyle& style = subject.style();
  return style.fill && style.fill_kind == FillKind::kTextured && !subject.mesh->paint.empty();
}

TilePaint paint_of(const Subject& subject) {
  const OverlayStyle& style = subject.style();
  TilePaint paint;
  paint.color = subject.line_style.color;
  paint.xray_color = subject.line_style.xray_color;
  paint.fill_opacity = style.fill ? style.fill_opacity : 0;
  paint.outline_px = style.outline ? style.outline_px : 0;
  paint.dashed = subject.line_style.dashed;
  paint.halo_opacity = style.halo_opacity;
  return paint;
}

}  // namespace

SurfacePainter::SurfacePainter(std::shared_ptr<const RayTable> rays,
                               std::shared_ptr<const RasterDevice> device)
    : device_(std::move(device)),
      rasterizer_(device_->make_backend(rays)),
      shader_(rays),
      compositor_(rays->width(), rays->height()) {}

bool SurfacePainter::needed_by(const OverlayStyle& style) {
  return style.outline || style.fill || style.wireframe || style.box2d;
}

TileCoverage SurfacePainter::draw(const FrameTarget& target, const Subject& subject,
                                  std::span<const Subject> all, Occluders& occluders) {
  const OverlayStyle& style = subject.style();
  const RenderMesh& mesh = *subject.mesh;
  const bool textured = shows_texture(subject);
  const bool faces = textured || (style.fill && style.shading == Shading::kSmooth);
  tile_.reset(rasterizer_->bounds(mesh, subject.camera_from_object, TileCompositor::kMargin),
              faces);
  if (tile_.rect().empty()) return {};
  const Status drawn = rasterizer_->draw(mesh, subject.camera_from_object, tile_);
  SL_CHECK(drawn.has_value(), "a device's rasterizer does not fail");
  const RasterTile* const hidden_by = occluders.over(tile_.rect(), subject, all, *rasterizer_);
  const TileCoverage coverage =
      hidden_by != nullptr
          ? compositor_.classify(tile_, *hidden_by, subject.occlusion_factor)
          : compositor_.classify(tile_, occluders.scene(), subject.occlusion_factor);
  if (coverage.bounds.empty() || (!style.fill && !style.outline)) return coverage;
  if (faces) shader_.run(mesh, subject.camera_from_object, style.shading, textured, tile_);
  target.blend(compositor_.compose(tile_, paint_of(subject), textured ? &shader_ : nullptr));
  return coverage;
}

}  // namespace sightline::render
