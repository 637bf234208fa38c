// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/camera_renderer.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "draw.hpp"
#include "glyph_atlas.hpp"
#include "hidden_tile.hpp"
#include "marks.hpp"
#include "sightline/base/check.hpp"
#include "sightline/image/blend.hpp"
#include "sightline/render/label.hpp"
#include "sightline/render/mesh_levels.hpp"
#include "sightline/render/raster.hpp"
#include "sightline/render/static_depth.hpp"
#include "surface_shader.hpp"
#include "text_tile.hpp"
#include "tile_compositor.hpp"

namespace sightline {
namespace {

constexpr Yuv kWhite{235, 128, 128};
constexpr int kMostTextCharacters = 96;
constexpr int kMostTextLines = 3;
constexpr int kCornerInset = 8;

/// A picture being drawn into, I420 or NV12.
struct Surface {
  draw::Canvas canvas;
  const MutableI420View* i420 = nullptr;
  const MutableNv12View* nv12 = nullptr;

  void blend(const OverlayTileView& tile) const {
    if (i420 != nullptr) {
      blend_tile(tile, *i420);
    } else {
      blend_tile(tile, *nv12);
    }
  }
};

/// A box of frame pixels around what was drawn of an object; the label goes beside it.
struct Extent {
  float left, top, right, bottom;
};

bool writes_text(const OverlayStyle& style) {
  return style.label || style.offscreen || style.status || style.last_seen;
}

int as_int(float value) {
  return std::isfinite(value) ? static_cast<int>(std::clamp(value, -32768.0f, 32767.0f)) : 0;
}

bool overlap(const TileRect& a, const TileRect& b) {
  return a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height;
}

bool in_range(double value, double low, double high) { return value >= low && value <= high; }

Status check_style(const OverlayObject& object, const std::string& camera) {
  const OverlayStyle& style = object.style;
  const auto refuse = [&](const char* what, const char* range) {
    return make_error(ErrorCode::kInvalidInput, camera, "overlay of {}: {} must be {}", object.name,
                      what, range);
  };
  if (object.mesh == nullptr) return refuse("its mesh", "given");
  if (!in_range(style.fill_opacity, 0, 1)) return refuse("fill opacity", "between 0 and 1");
  if (!in_range(style.halo_opacity, 0, 1)) return refuse("halo opacity", "between 0 and 1");
  if (!in_range(style.outline_px, 2, 4)) return refuse("outline width", "2 to 4 px");
  if (!in_range(style.line_px, 2, 8)) return refuse("line width", "2 to 8 px");
  if (!in_range(style.font_px, 8, 64)) return refuse("font size", "8 to 64 px");
  if (!in_range(style.ellipse_sigmas, 0.5, 10)) return refuse("ellipse", "0.5 to 10 sigmas");
  if (!in_range(style.trail_seconds, 0, 3600)) return refuse("trail", "0 to 3600 seconds");
  return {};
}

Status check_sizes(const CalibratedCamera& camera, const RayTable* rays, const StaticDepth* scene,
                   const RenderOptions& options) {
  const int width = camera.model.width();
  const int height = camera.model.height();
  if (rays == nullptr || rays->width() != width || rays->height() != height) {
    return make_error(ErrorCode::kInvalidInput, camera.name,
                      "the ray table is not for this camera's {}x{} pixels", width, height);
  }
  if (scene != nullptr && (scene->width() < width || scene->height() < height)) {
    return make_error(ErrorCode::kInvalidInput, camera.name,
                      "the static depth is {}x{}, the camera {}x{} pixels", scene->width(),
                      scene->height(), width, height);
  }
  if (!in_range(options.detail_px, 0, 10)) {
    return make_error(ErrorCode::kInvalidInput, camera.name, "detail must be between 0 and 10 px");
  }
  if (!in_range(options.depth_tolerance, 0, 1) ||
      !in_range(options.depth_tolerance_sigmas, 0, 100)) {
    return make_error(ErrorCode::kInvalidInput, camera.name,
                      "depth tolerance must be between 0 and 1, and 0 to 100 sigmas");
  }
  return {};
}

}  // namespace

class CameraRenderer::Impl {
 public:
  Impl(CalibratedCamera calibrated, CameraId camera_id, std::vector<OverlayObject> shown,
       std::shared_ptr<const RayTable> rays, std::shared_ptr<const StaticDepth> static_depth,
       std::shared_ptr<const RasterDevice> device, const RenderOptions& render_options)
      : id(camera_id),
        objects(std::move(shown)),
        camera_(std::move(calibrated)),
        camera_from_world_(camera_.world_from_camera.inverse()),
        scene_(std::move(static_depth)),
        options_(render_options),
        rays_(std::move(rays)),
        device_(std::move(device)),
        rasterizer_(device_->make_backend(rays_)),
        surfaces_(rays_),
        compositor_(camera_.model.width(), camera_.model.height()),
        remembered_(objects.size()),
        fonts_(objects.size(), nullptr) {
    order_.reserve(objects.size());
    pieces_.segments.reserve(1024);
    pieces_.flags.reserve(1024);
    points_.reserve(256);
  }

  Status load_fonts() {
    for (size_t i = 0; i < objects.size(); ++i) {
      const OverlayStyle& style = objects[i].style;
      if (!writes_text(style)) continue;
      for (const auto& font : font_sizes_) {
        if (font->em_px == style.font_px) fonts_[i] = font.get();
      }
      if (fonts_[i] != nullptr) continue;
      SL_ASSIGN(auto atlas, GlyphAtlas::create(options_.font_file, style.font_px));
      font_sizes_.push_back(std::make_unique<Font>(
          Font{style.font_px, TextTile(std::move(atlas), kMostTextCharacters, kMostTextLines)}));
      fonts_[i] = font_sizes_.back().get();
    }
    return {};
  }

  void draw(const Surface& surface, Time capture, std::span<const PoseTrackPtr> tracks,
            std::vector<PoseAt>& poses, const FrameHints& hints) {
    SL_CHECK(tracks.size() == objects.size(), "one track per object");
    SL_CHECK(surface.canvas.y.width == camera_.model.width() &&
                 surface.canvas.y.height == camera_.model.height(),
             "the picture has the camera's size");
    surface_ = &surface;
    hints_ = hints;
    capture_ = capture;
    gather_line_hiders();
    poses.resize(objects.size());
    order_.clear();
    for (size_t i = 0; i < objects.size(); ++i) {
      read_pose(i, tracks[i].get(), poses[i]);
      if (poses[i].source != PoseSource::kNone) order_.push_back(i);
    }
    poses_ = poses;
    sort_far_to_near(poses);
    for (const size_t i : order_) draw_object(i, poses[i].estimate, tracks[i].get());
    draw_absent(poses);
    surface_ = nullptr;
    hints_ = {};
    poses_ = {};
  }

  const CameraId id;
  const std::vector<OverlayObject> objects;

 private:
  struct Font {
    int em_px;
    TextTile text;
  };

  /// What one object's drawing needs to know.
  struct Subject {
    const OverlayObject& object;
    const RenderMesh& mesh;  ///< the level of it that is drawn
    const PoseEstimate& estimate;
    Rigid3 camera_from_object;
    Eigen::Vector3d center;  ///< of the bounding sphere, camera frame
    marks::Look look;
    float hide_factor;  ///< the scene hides what has 1/z smaller by this factor
    Font* font;
  };

  void read_pose(size_t i, const PoseTrack* track, PoseAt& pose) {
    if (track != nullptr) {
      pose = track->at(capture_);
    } else {
      pose = {};
    }
    // A pose that is no number is none.
    if (pose.source == PoseSource::kNone || !has_pose(pose.estimate.state) ||
        !pose.estimate.world_from_object.matrix().allFinite()) {
      pose.source = PoseSource::kNone;
      pose.estimate = {};
      pose.estimate.state = state_without_pose(track);
    }
    pose.estimate.object = objects[i].id;
    pose.estimate.time = capture_;
    if (pose.source != PoseSource::kNone) remembered_[i] = pose.estimate;
  }

  Eigen::Vector3d center_in_camera(size_t i, const PoseEstimate& estimate) const {
    return camera_from_world_ *
           (estimate.world_from_object * objects[i].mesh->center.cast<double>());
  }

  /// Insertion sort: few objects, stable, no allocation.
  void sort_far_to_near(const std::vector<PoseAt>& poses) {
    const auto range = [&](size_t i) { return center_in_camera(i, poses[i].estimate).norm(); };
    for (size_t i = 1; i < order_.size(); ++i) {
      for (size_t j = i; j > 0 && range(order_[j]) > range(order_[j - 1]); --j) {
        std::swap(order_[j], order_[j - 1]);
      }
    }
  }

  Subject subject_of(size_t i, const PoseEstimate& estimate) const {
    const OverlayObject& object = objects[i];
    const OverlayStyle& style = object.style;
    Rgb hue = style.color;
    if (estimate.state == TrackState::kDegraded) hue = style.degraded_color;
    if (estimate.state == TrackState::kCoasting) hue = style.coasting_color;
    const Eigen::Vector3d center = center_in_camera(i, estimate);
    const Rigid3 camera_from_object = camera_from_world_ * estimate.world_from_object;
    const RenderMesh& mesh =
        object.levels == nullptr
            ? *object.mesh
            : object.levels->choose(*rays_, camera_from_object, options_.detail_px);
    const float factor = hide_factor(options_.depth_tolerance, options_.depth_tolerance_sigmas,
                                     estimate.sigma_translation(), center.z());
    return {object,
            mesh,
            estimate,
            camera_from_object,
            center,
            {to_yuv(hue), to_yuv(style.xray_color), style.line_px,
             estimate.state == TrackState::kCoasting, style.halo_opacity},
            factor,
            fonts_[i]};
  }

  void draw_object(size_t i, const PoseEstimate& estimate, const PoseTrack* track) {
    const Subject subject = subject_of(i, estimate);
    const OverlayStyle& style = subject.object.style;
    if (style.trail && track != nullptr) draw_trail(subject, *track);
    const std::optional<marks::Circle> circle =
        marks::sphere_circle(camera_.model, subject.center, subject.object.mesh->radius);
    TileCoverage coverage;
    if (needs_raster(style)) coverage = draw_tile(subject);
    if (!in_picture(style, coverage, circle)) {
      if (style.offscreen) draw_offscreen(subject);
      return;
    }
    draw_lines(subject);
    const Extent extent = draw_marker(subject, coverage, circle);
    if (style.label) draw_label(subject, extent);
  }

  static bool needs_raster(const OverlayStyle& style) {
    return style.outline || style.fill || style.wireframe || style.box2d;
  }

  /// Rasterised: some pixel shows the object (or its centre, if it is smaller than a pixel). Not
  /// rasterised: its circle reaches into the picture.
  bool in_picture(const OverlayStyle& style, const TileCoverage& coverage,
                  const std::optional<marks::Circle>& circle) const {
    if (!coverage.bounds.empty()) return true;
    if (!circle) return false;
    if (needs_raster(style)) return camera_.model.contains(circle->center.cast<double>());
    const auto beyond = [&](float at, int size) {
      return at + circle->radius < -0.5f || at - circle->radius > static_cast<float>(size) - 0.5f;
    };
    return !beyond(circle->center.x(), camera_.model.width()) &&
           !beyond(circle->center.y(), camera_.model.height());
  }

  TileCoverage draw_tile(const Subject& subject) {
    const OverlayStyle& style = subject.object.style;
    const RenderMesh& mesh = subject.mesh;
    const bool textured = shows_texture(subject);
    const bool faces = textured || (style.fill && style.shading == Shading::kSmooth);
    tile_.reset(rasterizer_->bounds(mesh, subject.camera_from_object, TileCompositor::kMargin),
                faces);
    if (tile_.rect().empty()) return {};
    const Status drawn = rasterizer_->draw(mesh, subject.camera_from_object, tile_);
    SL_CHECK(drawn.has_value(), "a device's rasteriser does not fail");
    const TileCoverage coverage =
        more_hides(subject) ? compositor_.classify(tile_, hiders_, subject.hide_factor)
                            : compositor_.classify(tile_, scene_.get(), subject.hide_factor);
    if (coverage.bounds.empty() || (!style.fill && !style.outline)) return coverage;
    TilePaint paint;
    paint.color = subject.look.color;
    paint.xray_color = subject.look.xray_color;
    paint.fill_opacity = style.fill ? style.fill_opacity : 0;
    paint.outline_px = style.outline ? style.outline_px : 0;
    paint.dashed = subject.look.dashed;
    paint.halo_opacity = style.halo_opacity;
    if (faces) surfaces_.run(mesh, subject.camera_from_object, style.shading, textured, tile_);
    surface_->blend(compositor_.compose(tile_, paint, textured ? &surfaces_ : nullptr));
    return coverage;
  }

  static bool shows_texture(const Subject& subject) {
    const OverlayStyle& style = subject.object.style;
    return style.fill && style.fill_kind == FillKind::kTextured && !subject.mesh.paint.empty();
  }

  /// If other objects or what was learned may hide this one: puts them and the scene into hiders_,
  /// over its tile.
  bool more_hides(const Subject& subject) {
    bool any = hints_.hidden != nullptr;
    if (any) start_hiders();
    for (const size_t i : order_) {
      if (&objects[i] == &subject.object) continue;
      const Subject other = subject_of(i, poses_[i].estimate);
      const TileRect rect = rasterizer_->bounds(other.mesh, other.camera_from_object, 0);
      if (rect.empty() || !overlap(rect, tile_.rect())) continue;
      if (!any) start_hiders();
      any = true;
      const Status drawn = rasterizer_->draw(other.mesh, other.camera_from_object, hiders_);
      SL_CHECK(drawn.has_value(), "a device's rasteriser does not fail");
    }
    return any;
  }

  void start_hiders() {
    hiders_.reset(tile_.rect());
    add_scene(hiders_);
  }

  /// The static scene and what was learned of it, over the tile's rectangle.
  void add_scene(RasterTile& tile) const {
    const TileRect& rect = tile.rect();
    if (scene_ != nullptr && !scene_->empty()) {
      const int width = std::min(rect.width, scene_->width() - rect.x);
      const int height = std::min(rect.height, scene_->height() - rect.y);
      for (int y = 0; y < height; ++y) {
        std::copy_n(scene_->row(rect.y + y) + rect.x, width, tile.inverse_depth(y));
      }
    }
    if (hints_.hidden != nullptr) add_hidden_depth(*hints_.hidden, tile);
  }

  /// Boxes and axes reach beyond the silhouette, so they have a tile of their own.
  void gather_line_hiders() {
    constexpr int kBeyond = 128;
    line_hiders_ = scene_ != nullptr && !scene_->empty() ? &scene_->tile() : nullptr;
    const bool lines = std::ranges::any_of(objects, [](const OverlayObject& object) {
      return object.style.box3d || object.style.axes;
    });
    if (hints_.hidden == nullptr || !lines) return;
    const TileRect rect =
        rect_around(*hints_.hidden, kBeyond, rays_->even_width(), rays_->even_height());
    if (rect.empty()) return;
    around_.reset(rect);
    add_scene(around_);
    line_hiders_ = &around_;
  }

  void draw_lines(const Subject& subject) {
    const OverlayStyle& style = subject.object.style;
    const RenderMesh& mesh = *subject.object.mesh;
    if (style.wireframe && !tile_.rect().empty()) draw_wireframe(subject);
    if (style.box3d) {
      pieces_.clear();
      marks::add_box(*rays_, line_hiders_, subject.hide_factor, subject.camera_from_object,
                     mesh.min_corner.cast<double>(), mesh.max_corner.cast<double>(), pieces_);
      draw_with_halo(subject.look);
    }
    if (style.axes) draw_axes(subject);
    if (style.ellipse || style.cross) draw_center(subject);
  }

  void draw_center(const Subject& subject) {
    const OverlayStyle& style = subject.object.style;
    const auto pixel = camera_.model.project(subject.center);
    if (!pixel) return;
    const draw::Point center = pixel->cast<float>();
    if (style.ellipse) {
      const auto spread = marks::pixel_covariance(camera_.model, subject.camera_from_object,
                                                  subject.estimate.pose_covariance(),
                                                  subject.object.mesh->center.cast<double>());
      if (spread) {
        marks::draw_ellipse(surface_->canvas, center, *spread, style.ellipse_sigmas, subject.look,
                            points_);
      }
    }
    if (style.cross) marks::draw_cross(surface_->canvas, center, 8, subject.look);
  }

  void draw_with_halo(const marks::Look& look) {
    for (const bool halo : {true, false}) {
      marks::draw_pieces(surface_->canvas, pieces_, look, halo, points_);
    }
  }

  /// Feature edges; those that the object itself hides are left out or dashed.
  void draw_wireframe(const Subject& subject) {
    edges_.clear();
    visible_edges(*rays_, subject.mesh, subject.camera_from_object, tile_, edges_);
    pieces_.clear();
    for (const EdgeSegment& edge : edges_) {
      if (edge.visible) {
        add_seen_edge(edge);
      } else if (subject.object.style.hidden_lines) {
        pieces_.segments.push_back(edge);
        pieces_.flags.push_back(uint8_t{marks::kTurnedAway});
      }
    }
    marks::draw_pieces(surface_->canvas, pieces_, subject.look, false, points_);
  }

  /// Cut into short pieces where the scene hides some of the object, to find where it begins.
  void add_seen_edge(const EdgeSegment& edge) {
    constexpr float kPiece = 3;
    const float length = std::hypot(edge.x1 - edge.x0, edge.y1 - edge.y0);
    const int count = compositor_.any_hidden() ? static_cast<int>(length / kPiece) + 1 : 1;
    EdgeSegment piece = edge;
    for (int i = 1; i <= count; ++i) {
      const float share = static_cast<float>(i) / static_cast<float>(count);
      piece.x1 = i == count ? edge.x1 : edge.x0 + share * (edge.x1 - edge.x0);
      piece.y1 = i == count ? edge.y1 : edge.y0 + share * (edge.y1 - edge.y0);
      const bool behind =
          compositor_.hidden_near(static_cast<int>(std::lround(0.5f * (piece.x0 + piece.x1))),
                                  static_cast<int>(std::lround(0.5f * (piece.y0 + piece.y1))));
      pieces_.segments.push_back(piece);
      pieces_.flags.push_back(behind ? uint8_t{marks::kBehindScene} : uint8_t{0});
      piece.x0 = piece.x1;
      piece.y0 = piece.y1;
    }
  }

  /// Far tips first, so that the nearer axis lies on top.
  void draw_axes(const Subject& subject) {
    const std::array<Yuv, 3> hues = {to_yuv({255, 60, 60}), to_yuv({60, 230, 60}),
                                     to_yuv({80, 130, 255})};
    const double length = 0.9 * static_cast<double>(subject.object.mesh->radius);
    const Eigen::Vector3d origin = subject.camera_from_object.translation;
    std::array<int, 3> order = {0, 1, 2};
    const auto tip = [&](int axis) -> Eigen::Vector3d {
      return subject.camera_from_object * (length * Eigen::Vector3d::Unit(axis));
    };
    std::ranges::sort(order, [&](int a, int b) { return tip(a).z() > tip(b).z(); });
    for (const int axis : order) {
      pieces_.clear();
      marks::add_line(*rays_, line_hiders_, subject.hide_factor, origin, tip(axis), 0, 0, pieces_);
      marks::Look look = subject.look;
      look.color = look.xray_color = hues[static_cast<size_t>(axis)];
      draw_with_halo(look);
    }
  }

  /// The path of the object's centre, from the track's history, fading with age.
  void draw_trail(const Subject& subject, const PoseTrack& track) {
    const double span = subject.object.style.trail_seconds;
    if (span <= 0) return;
    std::optional<draw::Point> previous;
    const auto reach = [&](const std::optional<Eigen::Vector2d>& pixel, Time when, bool last) {
      if (!pixel) {
        previous.reset();
        return;
      }
      const draw::Point here = pixel->cast<float>();
      constexpr float kShortest = 3;
      if (previous && !last && (here - *previous).norm() < kShortest) return;
      if (previous) {
        const double age = to_seconds(capture_ - when) / span;
        const auto opacity = static_cast<float>(std::clamp(1 - age, 0.0, 1.0));
        draw::line(surface_->canvas, *previous, here,
                   {subject.look.color, subject.look.line_px, opacity, false});
      }
      previous = here;
    };
    const Eigen::Vector3d center = subject.object.mesh->center.cast<double>();
    for (const PoseEstimate& past : track.history()) {
      if (past.time >= capture_) break;
      if (to_seconds(capture_ - past.time) > span) continue;
      if (has_pose(past.state)) {
        reach(camera_.model.project(camera_from_world_ * (past.world_from_object * center)),
              past.time, false);
      } else {
        previous.reset();
      }
    }
    reach(camera_.model.project(subject.center), capture_, true);
  }

  /// Circle and upright box; returns the extent of what there is, drawn or not.
  Extent draw_marker(const Subject& subject, const TileCoverage& coverage,
                     const std::optional<marks::Circle>& circle) {
    const OverlayStyle& style = subject.object.style;
    const TileRect& bounds = coverage.bounds;
    if (style.circle && circle) marks::draw_circle(surface_->canvas, *circle, subject.look);
    std::optional<Extent> extent;
    if (!bounds.empty()) {
      extent = extent_of(bounds);
    } else if (circle) {
      extent = extent_of(*circle);
    }
    if (style.box2d && extent) {
      marks::draw_box2d(surface_->canvas, {extent->left, extent->top},
                        {extent->right, extent->bottom}, subject.look);
    }
    if (circle && (style.circle || !extent)) extent = extent_of(*circle);
    return extent.value_or(Extent{0, 0, 0, 0});
  }

  /// Three to four pixels off, so that the line does not lie on the outline, and in the middle of a
  /// chroma sample, so that all four sides have the same colour.
  static Extent extent_of(const TileRect& bounds) {
    const auto low = [](int first) { return static_cast<float>((first - 2) & ~1) - 1.5f; };
    const auto high = [](int end) { return static_cast<float>((end + 3) & ~1) + 0.5f; };
    return {low(bounds.x), low(bounds.y), high(bounds.x + bounds.width),
            high(bounds.y + bounds.height)};
  }

  static Extent extent_of(const marks::Circle& circle) {
    return {circle.center.x() - circle.radius, circle.center.y() - circle.radius,
            circle.center.x() + circle.radius, circle.center.y() + circle.radius};
  }

  void draw_label(const Subject& subject, const Extent& extent) {
    const LabelText text =
        label_text(subject.object.name, subject.estimate, camera_.world_from_camera, capture_);
    const std::array<Yuv, 2> colors = {subject.look.color, kWhite};
    TextTile& tile = subject.font->text;
    tile.set(text.view(), colors);
    put_beside(tile, extent);
  }

  /// Above the extent if there is room, else below, else where it fits.
  void put_beside(const TextTile& tile, const Extent& extent) const {
    const int above = as_int(extent.top) - tile.height();
    const int y = above >= 0 ? above : as_int(extent.bottom) + 2;
    put_inside(tile, as_int(extent.left), y);
  }

  void put_inside(const TextTile& tile, int x, int y) const {
    const int right = std::max(camera_.model.width() - tile.width(), 0);
    const int bottom = std::max(camera_.model.height() - tile.height(), 0);
    surface_->blend(tile.at(std::clamp(x, 0, right), std::clamp(y, 0, bottom)));
  }

  void draw_offscreen(const Subject& subject) {
    const auto size = static_cast<float>(subject.object.style.font_px);
    const marks::Arrow arrow = marks::offscreen_arrow(camera_.model, subject.center, 4);
    marks::draw_arrow(surface_->canvas, arrow, size, subject.look.color);
    const LabelText text =
        offscreen_text(subject.object.name, subject.camera_from_object.translation.norm());
    TextTile& tile = subject.font->text;
    tile.set(text.view(), std::span(&kWhite, 1));
    // Towards the middle of the picture, clear of the arrow.
    const draw::Point half(0.5f * static_cast<float>(tile.width()),
                           0.5f * static_cast<float>(tile.height()));
    const float clear = 1.3f * size + half.cwiseProduct(arrow.direction).norm();
    const draw::Point corner = arrow.tip - clear * arrow.direction - half;
    put_inside(tile, as_int(corner.x()), as_int(corner.y()));
  }

  /// "searching" and "lost" in the corner, one line an object; and where it was last, if asked.
  void draw_absent(const std::vector<PoseAt>& poses) {
    int y = kCornerInset;
    for (size_t i = 0; i < objects.size(); ++i) {
      if (poses[i].source != PoseSource::kNone) continue;
      const OverlayStyle& style = objects[i].style;
      const TrackState state = poses[i].estimate.state;
      if (style.last_seen && state == TrackState::kLost && remembered_[i]) draw_last_seen(i);
      if (!style.status) continue;
      TextTile& tile = fonts_[i]->text;
      tile.set(status_text(objects[i].name, state).view(), std::span(&kWhite, 1));
      put_inside(tile, kCornerInset, y);
      y += tile.height();
    }
  }

  void draw_last_seen(size_t i) {
    const PoseEstimate& last = *remembered_[i];
    const auto circle =
        marks::sphere_circle(camera_.model, center_in_camera(i, last), objects[i].mesh->radius);
    if (!circle || !camera_.model.contains(circle->center.cast<double>())) return;
    const OverlayStyle& style = objects[i].style;
    const Yuv grey = to_yuv(style.last_seen_color);
    marks::draw_circle(surface_->canvas, *circle,
                       {grey, grey, style.line_px, true, style.halo_opacity});
    TextTile& tile = fonts_[i]->text;
    tile.set(last_seen_text(objects[i].name, capture_ - last.last_measured).view(),
             std::span(&grey, 1));
    put_beside(tile, extent_of(*circle));
  }

  const CalibratedCamera camera_;
  const Rigid3 camera_from_world_;
  const std::shared_ptr<const StaticDepth> scene_;
  const RenderOptions options_;

  const std::shared_ptr<const RayTable> rays_;
  const std::shared_ptr<const RasterDevice> device_;
  const std::unique_ptr<RasterBackend> rasterizer_;
  RasterTile tile_, hiders_, around_;
  const RasterTile* line_hiders_ = nullptr;  ///< during draw() only; null: none
  SurfaceShader surfaces_;
  TileCompositor compositor_;
  std::vector<EdgeSegment> edges_;
  marks::Pieces pieces_;
  marks::Points points_;
  std::vector<size_t> order_;
  std::vector<std::optional<PoseEstimate>> remembered_;  ///< per object, the last one drawn
  std::vector<std::unique_ptr<Font>> font_sizes_;
  std::vector<Font*> fonts_;  ///< per object; null: writes no text

  const Surface* surface_ = nullptr;  ///< during draw() only
  std::span<const PoseAt> poses_;     ///< during draw() only, by object
  FrameHints hints_;                  ///< during draw() only
  Time capture_{};
};

CameraRenderer::CameraRenderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
CameraRenderer::~CameraRenderer() = default;

Result<std::unique_ptr<CameraRenderer>> CameraRenderer::create(
    const CalibratedCamera& camera, CameraId id, std::vector<OverlayObject> objects,
    std::shared_ptr<const RayTable> rays, std::shared_ptr<const StaticDepth> static_depth,
    const RenderOptions& options) {
  SL_RETURN_IF_ERROR(check_sizes(camera, rays.get(), static_depth.get(), options));
  for (const OverlayObject& object : objects) {
    SL_RETURN_IF_ERROR(check_style(object, camera.name));
  }
  SL_ASSIGN(auto device, RasterDevice::open(options.backend));
  auto impl = std::make_unique<Impl>(camera, id, std::move(objects), std::move(rays),
                                     std::move(static_depth), std::move(device), options);
  SL_RETURN_IF_ERROR(impl->load_fonts());
  return std::unique_ptr<CameraRenderer>(new CameraRenderer(std::move(impl)));
}

void CameraRenderer::draw(const MutableI420View& picture, Time capture,
                          std::span<const PoseTrackPtr> tracks, std::vector<PoseAt>& poses_out,
                          const FrameHints& hints) {
  impl_->draw({draw::canvas_of(picture), &picture, nullptr}, capture, tracks, poses_out, hints);
}

void CameraRenderer::draw(const MutableNv12View& picture, Time capture,
                          std::span<const PoseTrackPtr> tracks, std::vector<PoseAt>& poses_out,
                          const FrameHints& hints) {
  impl_->draw({draw::canvas_of(picture), nullptr, &picture}, capture, tracks, poses_out, hints);
}

CameraId CameraRenderer::camera() const { return impl_->id; }
const std::vector<OverlayObject>& CameraRenderer::objects() const { return impl_->objects; }

}  // namespace sightline
