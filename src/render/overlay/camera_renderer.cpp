// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/overlay/camera_renderer.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "render/overlay/frame_subjects.hpp"
#include "render/overlay/frame_target.hpp"
#include "render/overlay/lines/bounding_marks.hpp"
#include "render/overlay/lines/line_painter.hpp"
#include "render/overlay/lines/trail.hpp"
#include "render/overlay/occluders.hpp"
#include "render/overlay/overlay_checks.hpp"
#include "render/overlay/surface_painter.hpp"
#include "render/overlay/text/text_layer.hpp"
#include "sightline/base/check.hpp"
#include "sightline/render/raster/turning_depth.hpp"

namespace sightline {

using namespace render;  // NOLINT: the room's own parts

namespace {

constexpr Yuv kWhite{235, 128, 128};

bool shows_lines_in_space(const OverlayObject& object) {
  return object.style.box3d || object.style.axes;
}

std::string_view notice_of(AxesState state) {
  switch (state) {
    case AxesState::kFrozen:
      return "angles frozen";
    case AxesState::kZoomed:
      return "zoomed";
    default:
      return "angles unknown";
  }
}

std::vector<const OverlayStyle*> styles_of(std::span<const OverlayObject> objects) {
  std::vector<const OverlayStyle*> styles;
  for (const OverlayObject& object : objects) styles.push_back(&object.style);
  return styles;
}

}  // namespace

/// One frame: which objects there are, then each of them from far to near, then the texts.
class CameraRenderer::Impl {
 public:
  Impl(CalibratedCamera calibrated, CameraId camera_id, std::vector<OverlayObject> shown,
       std::shared_ptr<const RayTable> rays, std::shared_ptr<const StaticDepth> scene,
       std::shared_ptr<const RasterDevice> device, const RenderOptions& options, TextLayer text,
       std::shared_ptr<TurningDepth> turning)
      : id(camera_id),
        objects(std::move(shown)),
        camera_(std::move(calibrated)),
        options_(options),
        turning_(std::move(turning)),
        rays_(std::move(rays)),
        subjects_(camera_, objects, options_),
        occluders_(std::move(scene), *rays_),
        surface_(rays_, std::move(device)),
        lines_(camera_, rays_),
        text_(std::move(text)) {}

  void draw(const FrameTarget& target, Time capture, std::span<const PoseTrackPtr> tracks,
            std::vector<PoseAt>& poses, const FrameHints& hints) {
    SL_CHECK(tracks.size() == objects.size(), "one track per object");
    SL_CHECK(target.width() == camera_.model.width() && target.height() == camera_.model.height(),
             "the image has the camera's size");
    if (hints.place != nullptr) turn_to(*hints.place);
    occluders_.begin(hints.hidden, std::ranges::any_of(objects, shows_lines_in_space));
    text_.begin();
    notice_ = hints.notice;
    const bool blind = hints.place != nullptr && !hints.place->trusted();
    if (blind) {
      subjects_.read_none(capture, tracks, poses);
      if (notice_.empty()) notice_ = notice_of(hints.place->state);
    } else {
      subjects_.read(capture, tracks, poses);
    }
    for (const Subject& subject : subjects_.all()) draw_object(target, subject, capture);
    for (size_t i = 0; i < objects.size(); ++i) {
      if (poses[i].source == PoseSource::kNone) {
        draw_absent(target, i, poses[i].estimate.state, capture, !blind);
      }
    }
    text_.draw(target);
  }

  const CameraId id;
  const std::vector<OverlayObject> objects;

 private:
  void turn_to(const CameraPlace& place) {
    camera_.world_from_camera = place.world_from_camera;
    subjects_.camera_moved();
    if (turning_ && place.trusted()) turning_->turn_to(place.world_from_camera);
  }

  void draw_object(const FrameTarget& target, const Subject& subject, Time capture) {
    const OverlayStyle& style = subject.style();
    if (style.trail) {
      draw_trail(target, camera_.model, subjects_.camera_from_world(), subject, capture);
    }
    const std::optional<marks::Circle> circle =
        marks::sphere_circle(camera_.model, subject.center, subject.object->mesh->radius);
    TileCoverage coverage;
    if (SurfacePainter::needed_by(style)) {
      coverage = surface_.draw(target, subject, subjects_.all(), occluders_);
    }
    if (!in_image(style, coverage, circle)) {
      if (style.offscreen) draw_offscreen(target, subject);
      return;
    }
    lines_.draw(target, subject, surface_, occluders_);
    const Extent extent = draw_bounding_marks(target, subject, coverage, circle);
    if (!style.label) return;
    text_.add_beside(subject.index,
                     label_text(subject.object->name, *subject.estimate, camera_.world_from_camera,
                                capture, notice_),
                     {subject.line_style.color, kWhite}, extent);
  }

  /// Rasterized: some pixel shows the object (or its center, if it is smaller than a pixel). Not
  /// rasterized: its circle reaches into the image.
  bool in_image(const OverlayStyle& style, const TileCoverage& coverage,
                const std::optional<marks::Circle>& circle) const {
    if (!coverage.bounds.empty()) return true;
    if (!circle) return false;
    if (SurfacePainter::needed_by(style)) {
      return camera_.model.contains(circle->center.cast<double>());
    }
    const auto beyond = [&](float at, int size) {
      return at + circle->radius < -0.5f || at - circle->radius > static_cast<float>(size) - 0.5f;
    };
    return !beyond(circle->center.x(), camera_.model.width()) &&
           !beyond(circle->center.y(), camera_.model.height());
  }

  void draw_offscreen(const FrameTarget& target, const Subject& subject) {
    const auto size = static_cast<float>(subject.style().font_px);
    const marks::Arrow arrow = marks::offscreen_arrow(camera_.model, subject.center, 4);
    marks::draw_arrow(target.canvas, arrow, size, subject.line_style.color);
    text_.add_offscreen(
        subject.index,
        offscreen_text(subject.object->name, subject.camera_from_object.translation.norm()), arrow,
        size);
  }

  /// "searching" and "lost" in the corner, one line an object; and where it was last, if asked.
  void draw_absent(const FrameTarget& target, size_t i, TrackState state, Time capture,
                   bool place_known) {
    const OverlayStyle& style = objects[i].style;
    if (place_known && style.last_seen && state == TrackState::kLost && subjects_.last_drawn(i)) {
      draw_last_seen(target, i, *subjects_.last_drawn(i), capture);
    }
    if (style.status) text_.add_status(i, status_text(objects[i].name, state, notice_));
  }

  void draw_last_seen(const FrameTarget& target, size_t i, const PoseEstimate& last, Time capture) {
    const auto circle = marks::sphere_circle(camera_.model, subjects_.center_in_camera(i, last),
                                             objects[i].mesh->radius);
    if (!circle || !camera_.model.contains(circle->center.cast<double>())) return;
    const OverlayStyle& style = objects[i].style;
    const Yuv gray = to_yuv(style.last_seen_color);
    marks::draw_circle(target.canvas, *circle,
                       {gray, gray, style.line_px, true, style.halo_opacity});
    text_.add_beside(i, last_seen_text(objects[i].name, capture - last.last_measured), {gray, gray},
                     extent_of(*circle));
  }

  CalibratedCamera camera_;  // one that turns: as in the newest frame
  const RenderOptions options_;
  const std::shared_ptr<TurningDepth> turning_;  // null: the scene stands still
  const std::shared_ptr<const RayTable> rays_;
  FrameSubjects subjects_;
  Occluders occluders_;
  SurfacePainter surface_;
  LinePainter lines_;
  TextLayer text_;
  std::string_view notice_;  // of one draw()
};

CameraRenderer::CameraRenderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
CameraRenderer::~CameraRenderer() = default;

Result<std::unique_ptr<CameraRenderer>> CameraRenderer::create(
    const CalibratedCamera& camera, CameraId id, std::vector<OverlayObject> objects,
    std::shared_ptr<const RayTable> rays, std::shared_ptr<const StaticDepth> static_depth,
    const RenderOptions& options, std::shared_ptr<TurningDepth> turning) {
  SL_RETURN_IF_ERROR(check_parts(camera, rays.get(), static_depth.get(), options));
  for (const OverlayObject& object : objects) {
    SL_RETURN_IF_ERROR(check_object(object, camera.name));
  }
  SL_ASSIGN(auto device, RasterDevice::open(options.backend));
  SL_ASSIGN(auto text, TextLayer::create(styles_of(objects), options.font_file,
                                         camera.model.width(), camera.model.height()));
  auto impl = std::make_unique<Impl>(camera, id, std::move(objects), std::move(rays),
                                     std::move(static_depth), std::move(device), options,
                                     std::move(text), std::move(turning));
  return std::unique_ptr<CameraRenderer>(new CameraRenderer(std::move(impl)));
}

void CameraRenderer::draw(const MutableI420View& image, Time capture,
                          std::span<const PoseTrackPtr> tracks, std::vector<PoseAt>& poses_out,
                          const FrameHints& hints) {
  impl_->draw({draw::canvas_of(image), &image, nullptr}, capture, tracks, poses_out, hints);
}

void CameraRenderer::draw(const MutableNv12View& image, Time capture,
                          std::span<const PoseTrackPtr> tracks, std::vector<PoseAt>& poses_out,
                          const FrameHints& hints) {
  impl_->draw({draw::canvas_of(image), nullptr, &image}, capture, tracks, poses_out, hints);
}

CameraId CameraRenderer::camera() const { return impl_->id; }
const std::vector<OverlayObject>& CameraRenderer::objects() const { return impl_->objects; }

}  // namespace sightline
