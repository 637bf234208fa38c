// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/overlay/virtual_camera.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "render/overlay/marks.hpp"
#include "render/overlay/text/label_placement.hpp"
#include "render/overlay/text/text_tile.hpp"
#include "sightline/image/convert.hpp"
#include "sightline/image/image.hpp"
#include "sightline/render/overlay/point_marks.hpp"

namespace sightline {
namespace {

constexpr Rgb kSkyTop{38, 42, 50}, kSkyBottom{70, 76, 88};
constexpr Rgb kGridColor{105, 112, 125};
constexpr Rgb kSceneColor{150, 158, 172};  // of a surface that faces the light
constexpr Rgb kAbsentColor{235, 70, 60}, kWatchingColor{190, 195, 205},
    kMeasuringColor{70, 225, 120};
constexpr std::array<Rgb, 3> kAxisColors = {Rgb{255, 80, 80}, Rgb{80, 230, 80}, Rgb{90, 140, 255}};
constexpr float kSceneSlack = 1.005f;  // lines on a surface are not behind it
constexpr int kGridHalf = 10;          // lines on either side of the middle
constexpr float kRayOpacity = 0.35f;

Rgb mix(Rgb a, Rgb b, double share) {
  const auto one = [share](uint8_t x, uint8_t y) {
    return static_cast<uint8_t>(std::lround(x + share * (y - x)));
  };
  return {one(a.r, b.r), one(a.g, b.g), one(a.b, b.b)};
}

Rgb color_of(ViewedState state) {
  switch (state) {
    case ViewedState::kAbsent:
      return kAbsentColor;
    case ViewedState::kMeasuring:
      return kMeasuringColor;
    default:
      return kWatchingColor;
  }
}

// 1, 2 or 5 times a power of ten, at most `length`.
double round_step(double length) {
  const double decade = std::pow(10.0, std::floor(std::log10(length)));
  for (const double digit : {5.0, 2.0}) {
    if (digit * decade <= length) return digit * decade;
  }
  return decade;
}

}  // namespace

class VirtualCamera::Impl {
 public:
  Impl(CalibratedCamera view, std::vector<CalibratedCamera> cameras,
       std::unique_ptr<CameraRenderer> renderer, std::shared_ptr<const RayTable> rays,
       std::shared_ptr<const StaticDepth> scene, TextTile text, double grid_m)
      : view_(std::move(view)),
        view_from_world_(view_.world_from_camera.inverse()),
        cameras_(std::move(cameras)),
        renderer_(std::move(renderer)),
        rays_(std::move(rays)),
        scene_(std::move(scene)),
        text_(std::move(text)),
        background_(view_.model.width(), view_.model.height()) {
    middle_ = where_cameras_look(cameras_);
    for (const CalibratedCamera& camera : cameras_) {
      reach_ = std::max(reach_, (camera.world_from_camera.translation - middle_).norm());
    }
    draw_background(grid_m > 0 ? grid_m : round_step(0.4 * reach_));
  }

  const CalibratedCamera& view() const { return view_; }

  void draw(const MutableI420View& image, Time time, std::span<const PoseTrackPtr> tracks,
            std::span<const ViewedState> states, const ScenePoints* points,
            std::vector<PoseAt>& poses) {
    SL_CHECK(states.size() == cameras_.size(), "one state per camera");
    copy_i420(background_.view(), image);
    const draw::Canvas canvas = draw::canvas_of(image);
    draw_rays(canvas, time, tracks, states);
    for (size_t i = 0; i < cameras_.size(); ++i) draw_frustum(canvas, i, states[i]);
    renderer_->draw(image, time, tracks, poses);
    if (points != nullptr) draw_points(image, *points);
    for (size_t i = 0; i < cameras_.size(); ++i) draw_name(image, i, states[i]);
  }

 private:
  void draw_background(double step) {
    paint_sky();
    const MutableI420View image = background_.mutable_view();
    const draw::Canvas canvas = draw::canvas_of(image);
    paint_scene();
    draw_grid(canvas, step);
    draw_world_axes(canvas, step);
  }

  void paint_sky() {
    const MutableI420View to = background_.mutable_view();
    for (int y = 0; y < to.height(); ++y) {
      const Yuv color = to_yuv(mix(kSkyTop, kSkyBottom, static_cast<double>(y) / to.height()));
      std::fill_n(to.y.row(y), to.width(), color.y);
      if (y % 2 != 0) continue;
      std::fill_n(to.u.row(y / 2), to.u.width, color.u);
      std::fill_n(to.v.row(y / 2), to.v.width, color.v);
    }
  }

  /// Opaque surfaces under the light of the rasterizer.
  void paint_scene() {
    if (scene_ == nullptr || scene_->empty()) return;
    const MutableI420View to = background_.mutable_view();
    for (int y = 0; y < to.height(); ++y) {
      const float* depth = scene_->row(y);
      const uint8_t* shade = scene_->tile().shade(y);
      for (int x = 0; x < to.width(); ++x) {
        if (!(depth[x] > 0)) continue;
        const Yuv color = to_yuv(mix(Rgb{}, kSceneColor, 0.25 + 0.75 * shade[x] / 255.0));
        to.y.row(y)[x] = color.y;
        to.u.row(y / 2)[x / 2] = color.u;
        to.v.row(y / 2)[x / 2] = color.v;
      }
    }
  }

  void draw_grid(const draw::Canvas& canvas, double step) {
    const double half = kGridHalf * step;
    const double x0 = std::round(middle_.x() / step) * step;
    const double y0 = std::round(middle_.y() / step) * step;
    pieces_.clear();
    for (int i = -kGridHalf; i <= kGridHalf; ++i) {
      add_world_line({x0 + i * step, y0 - half, 0}, {x0 + i * step, y0 + half, 0});
      add_world_line({x0 - half, y0 + i * step, 0}, {x0 + half, y0 + i * step, 0});
    }
    draw_seen(canvas, {to_yuv(kGridColor), 1, 1, false});
  }

  void draw_world_axes(const draw::Canvas& canvas, double step) {
    for (int axis = 0; axis < 3; ++axis) {
      pieces_.clear();
      add_world_line(Eigen::Vector3d::Zero(), step * Eigen::Vector3d::Unit(axis));
      const Yuv color = to_yuv(kAxisColors[static_cast<size_t>(axis)]);
      marks::draw_pieces(canvas, pieces_, {color, color, 3, false}, false, points_);
    }
  }

  void add_world_line(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    const auto line = static_cast<uint32_t>(pieces_.segments.size());
    const RasterTile* scene = scene_ != nullptr && !scene_->empty() ? &scene_->tile() : nullptr;
    marks::add_line(*rays_, scene, kSceneSlack, view_from_world_ * a, view_from_world_ * b, line, 0,
                    pieces_);
  }

  /// Corners of the image at `depth` before the camera, in the world.
  std::array<Eigen::Vector3d, 4> frustum_corners(const CalibratedCamera& camera, double depth) {
    const double w = camera.model.width() - 0.5, h = camera.model.height() - 0.5;
    const std::array<Eigen::Vector2d, 4> pixels = {
        Eigen::Vector2d{-0.5, -0.5}, {w, -0.5}, {w, h}, {-0.5, h}};
    std::array<Eigen::Vector3d, 4> out;
    for (size_t i = 0; i < 4; ++i) {
      // A fisheye may see nothing in its corners; its axis stands in.
      const Eigen::Vector3d ray =
          camera.model.unproject(pixels[i]).value_or(Eigen::Vector3d::UnitZ());
      out[i] = camera.world_from_camera * Eigen::Vector3d(ray * (depth / std::max(ray.z(), 0.2)));
    }
    return out;
  }

  void draw_frustum(const draw::Canvas& canvas, size_t index, ViewedState state) {
    const CalibratedCamera& camera = cameras_[index];
    const auto corners = frustum_corners(camera, 0.18 * reach_);
    const Eigen::Vector3d eye = camera.world_from_camera.translation;
    pieces_.clear();
    for (size_t i = 0; i < 4; ++i) {
      add_world_line(eye, corners[i]);
      add_world_line(corners[i], corners[(i + 1) % 4]);
    }
    // A tip on the upper side says which way up it is.
    const Eigen::Vector3d top = 0.5 * (corners[0] + corners[1]);
    const Eigen::Vector3d tip = top + 0.25 * (top - 0.5 * (corners[2] + corners[3]));
    add_world_line(0.7 * corners[0] + 0.3 * corners[1], tip);
    add_world_line(0.3 * corners[0] + 0.7 * corners[1], tip);
    const Yuv color = to_yuv(color_of(state));
    marks::draw_with_halo(canvas, pieces_, {color, color, 2, state == ViewedState::kAbsent},
                          points_);
  }

  /// From the cameras that measure to what they measure.
  void draw_rays(const draw::Canvas& canvas, Time time, std::span<const PoseTrackPtr> tracks,
                 std::span<const ViewedState> states) {
    for (size_t object = 0; object < tracks.size(); ++object) {
      if (tracks[object] == nullptr) continue;
      const PoseAt pose = tracks[object]->at(time);
      if (pose.source == PoseSource::kNone || !has_pose(pose.estimate.state)) continue;
      const Eigen::Vector3d center = pose.estimate.world_from_object *
                                     renderer_->objects()[object].mesh->center.cast<double>();
      for (size_t i = 0; i < cameras_.size(); ++i) {
        if (states[i] == ViewedState::kMeasuring) draw_ray(canvas, i, center);
      }
    }
  }

  void draw_ray(const draw::Canvas& canvas, size_t camera, const Eigen::Vector3d& to) {
    pieces_.clear();
    add_world_line(cameras_[camera].world_from_camera.translation, to);
    draw_seen(canvas, {to_yuv(kMeasuringColor), 1, kRayOpacity, false});
  }

  /// What the scene does not hide of the pieces.
  void draw_seen(const draw::Canvas& canvas, const draw::Stroke& stroke) {
    for (const EdgeSegment& piece : pieces_.segments) {
      if (piece.visible) draw::line(canvas, {piece.x0, piece.y0}, {piece.x1, piece.y1}, stroke);
    }
  }

  void draw_points(const MutableI420View& image, const ScenePoints& points) {
    point_marks_.clear();
    marks_of_points(view_.model, view_from_world_, points.points, point_marks_);
    draw_point_marks(image, point_marks_, fit_depth_scale(point_marks_));
  }

  void draw_name(const MutableI420View& image, size_t index, ViewedState state) {
    const CalibratedCamera& camera = cameras_[index];
    const auto pixel = view_.model.project(view_from_world_ * camera.world_from_camera.translation);
    if (!pixel || !view_.model.contains(*pixel)) return;
    const Yuv color = to_yuv(color_of(state));
    text_.set(camera.name, {&color, 1});
    const int x = static_cast<int>(std::lround(pixel->x())) + 6;
    const int y = static_cast<int>(std::lround(pixel->y())) + 4;
    const TileRect at = render::LabelPlacement::inside(image.width(), image.height(), x, y,
                                                       text_.width(), text_.height());
    blend_tile(text_.at(at.x, at.y), image);
  }

  const CalibratedCamera view_;
  const Rigid3 view_from_world_;
  const std::vector<CalibratedCamera> cameras_;
  const std::unique_ptr<CameraRenderer> renderer_;
  const std::shared_ptr<const RayTable> rays_;
  const std::shared_ptr<const StaticDepth> scene_;
  TextTile text_;
  Image background_;
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();  ///< where the cameras look
  double reach_ = 0.2;                                ///< of the farthest camera from there [m]
  marks::Pieces pieces_;
  marks::Points points_;
  std::vector<PointMark> point_marks_;
};

VirtualCamera::VirtualCamera(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
VirtualCamera::~VirtualCamera() = default;

Result<std::unique_ptr<VirtualCamera>> VirtualCamera::create(const CalibratedCamera& view,
                                                             std::vector<CalibratedCamera> cameras,
                                                             std::vector<OverlayObject> objects,
                                                             std::span<const SceneMesh> scene,
                                                             const VirtualCameraOptions& options) {
  constexpr int kMaxCharacters = 64;
  const auto rays = RayTable::build(view.model);
  const auto depth =
      scene.empty() ? nullptr : StaticDepth::build(rays, view.world_from_camera, scene);
  SL_ASSIGN(auto renderer, CameraRenderer::create(view, CameraId(0), std::move(objects), rays,
                                                  depth, options.render));
  SL_ASSIGN(auto atlas, GlyphAtlas::create(options.render.font_file, options.font_px));
  auto impl = std::make_unique<Impl>(view, std::move(cameras), std::move(renderer), rays, depth,
                                     TextTile(std::move(atlas), kMaxCharacters, 1), options.grid_m);
  return std::unique_ptr<VirtualCamera>(new VirtualCamera(std::move(impl)));
}

int VirtualCamera::width() const { return impl_->view().model.width(); }
int VirtualCamera::height() const { return impl_->view().model.height(); }

void VirtualCamera::draw(const MutableI420View& image, Time time,
                         std::span<const PoseTrackPtr> tracks, std::span<const ViewedState> states,
                         const ScenePoints* points, std::vector<PoseAt>& poses_out) {
  SL_CHECK(image.width() == width() && image.height() == height(), "the view has another size");
  impl_->draw(image, time, tracks, states, points, poses_out);
}

OverlayStyle virtual_camera_style(OverlayStyle base) {
  base.circle = false;
  base.trail = true;
  base.fill_opacity = 0.85f;
  return base;
}

std::vector<ViewedState> viewed_states(std::span<const PoseTrackPtr> tracks, Time time,
                                       Duration lately, const std::vector<bool>& present) {
  CameraSet measuring = 0;
  for (const PoseTrackPtr& track : tracks) {
    if (track == nullptr) continue;
    for (const PoseEstimate& past : track->history()) {
      if (past.time <= time && time - past.time <= lately) measuring |= past.cameras;
    }
  }
  std::vector<ViewedState> states;
  for (size_t i = 0; i < present.size(); ++i) {
    const bool measures = (measuring & camera_bit(CameraId(static_cast<uint32_t>(i)))) != 0;
    states.push_back(!present[i] ? ViewedState::kAbsent
                     : measures  ? ViewedState::kMeasuring
                                 : ViewedState::kWatching);
  }
  return states;
}

}  // namespace sightline
