// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/scene/occlusion_learner.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "observe/scene/background_colors.hpp"
#include "observe/scene/object_projection.hpp"
#include "observe/scene/occlusion_cells.hpp"
#include "observe/scene/occlusion_evidence.hpp"
#include "observe/scene/surface_colors.hpp"
#include "sightline/base/recycling_pool.hpp"

namespace sightline {
namespace {

using observe::BackgroundColors;
using observe::CellColor;
using observe::CellGrid;
using observe::CellReader;
using observe::CellRect;
using observe::ObjectProjection;
using observe::OcclusionCells;
using observe::OcclusionEvidence;
using observe::SurfaceColors;

constexpr Duration kOthersWithin = std::chrono::milliseconds(100);
constexpr double kMaxPoseErrorPx = 4;  // one sigma of the pose, in this image
constexpr int kBackgroundMargin = 5;   // cells around an object that are not learned as background
constexpr int kPublishedMargin = 8;    // cells around an object: it moves until it is drawn
constexpr float kInFront = 25;  // squared sigmas from the background: something is in front of it
constexpr float kImageChanged = 0.5f;  // share of the image that differs from the background

}  // namespace

class OcclusionLearner::Impl {
 public:
  Impl(const CalibratedCamera& camera, CameraId id, std::vector<OccludableObject> objects)
      : camera_(camera),
        id_(id),
        camera_from_world_(camera.world_from_camera.inverse()),
        grid_(camera.model),
        background_(grid_.width(), grid_.height()),
        cells_(grid_.width(), grid_.height()) {
    for (OccludableObject& object : objects) {
      objects_.push_back(std::make_unique<Object>(std::move(object), camera.model));
    }
  }

  void step(const Frame& frame, std::span<const PoseTrackPtr> tracks);
  OcclusionDepthPtr hidden() const { return hidden_; }
  const StepResult& last_step() const { return result_; }

 private:
  struct Object {
    Object(OccludableObject given, const CameraModel& camera)
        : known(std::move(given)),
          renderer(known.depth(camera)),
          surface(known.center, known.radius) {}
    OccludableObject known;
    std::unique_ptr<DepthRenderer> renderer;
    SurfaceColors surface;
    ObjectProjection projection;
    bool visible = false;  ///< it has a pose, and some of it is in the image
    bool judged = false;   ///< ... which the other cameras hold
    CellRect before;       ///< where it was in the frame before
  };

  bool place(Object& object, const PoseTrack* track, Time capture);
  bool held_by_others(const PoseTrack& track, const PoseAt& at, Time capture) const;
  void learn_background(const CellReader& frame);
  void judge(Object& object, const CellReader& frame);
  void learn_surface(Object& object, const CellReader& frame);
  void forget_passing(Object& object);
  void publish(Time time);

  const CalibratedCamera camera_;
  const CameraId id_;
  const Rigid3 camera_from_world_;
  const CellGrid grid_;
  BackgroundColors background_;
  OcclusionCells cells_;
  OcclusionEvidence evidence_;  ///< of the object that is judged
  std::vector<std::unique_ptr<Object>> objects_;
  std::vector<CellRect> occupied_;
  std::vector<const ObjectProjection*> others_;

  RecyclingPool<OcclusionDepth> buffers_{4};
  OcclusionDepthPtr hidden_;
  bool image_changed_ = false;  ///< in the newest frame most of the image is not the background
  StepResult result_;
};

// The pose must stand without this camera's measurements.
bool OcclusionLearner::Impl::held_by_others(const PoseTrack& track, const PoseAt& at,
                                            Time capture) const {
  if (at.estimate.state != TrackState::kTracking) return false;
  CameraSet others = 0;
  for (auto past = track.history().rbegin(); past != track.history().rend(); ++past) {
    if (capture - past->time > kOthersWithin) break;
    if (past->time - capture <= kOthersWithin) others |= past->cameras;
  }
  if ((others & ~camera_bit(id_)) == 0) return false;
  const Eigen::Vector3d center = camera_from_world_ * at.estimate.world_from_object.translation;
  const double px = camera_.model.parameters().fx * at.estimate.sigma_translation();
  return px < kMaxPoseErrorPx * std::max(center.z(), 1e-3);
}

// False if nobody knows where the object is: then any cell may show it.
bool OcclusionLearner::Impl::place(Object& object, const PoseTrack* track, Time capture) {
  object.visible = object.judged = false;
  object.projection.clear();
  if (track == nullptr || track->empty()) return false;
  const PoseAt at = track->at(capture);
  if (at.source == PoseSource::kNone || !has_pose(at.estimate.state)) return false;
  const Rigid3 camera_from_object = camera_from_world_ * at.estimate.world_from_object;
  object.visible = object.projection.project(grid_, object.renderer->render(camera_from_object),
                                             camera_from_object);
  object.judged = object.visible && held_by_others(*track, at, capture);
  return at.estimate.state != TrackState::kCoasting;
}

void OcclusionLearner::Impl::learn_background(const CellReader& frame) {
  occupied_.clear();
  for (const auto& object : objects_) {
    if (!object->visible) continue;
    occupied_.push_back(grid_.grown(object->projection.rect(), kBackgroundMargin));
  }
  background_.learn(frame, occupied_);
  const bool changed_before = std::exchange(image_changed_, background_.changed() > kImageChanged);
  if (changed_before && !image_changed_) cells_.forget_passing();
}

void OcclusionLearner::Impl::judge(Object& object, const CellReader& frame) {
  const ObjectProjection& projection = object.projection;
  others_.clear();
  for (const auto& other : objects_) {
    if (other.get() != &object) others_.push_back(&other->projection);
  }
  evidence_.measure({grid_, background_, cells_, image_changed_}, projection, object.surface, frame,
                    others_);
  ++result_.judged;
  const CellRect& rect = projection.rect();
  for (int y = rect.top; y < rect.bottom; ++y) {
    for (int x = rect.left; x < rect.right; ++x) {
      const float w = projection.depth(projection.at(x, y));
      if (w <= 0) continue;
      const auto change = cells_.judge(x, y, w, evidence_.mean_at(projection, x, y));
      result_.learned += change == OcclusionCells::Change::kLearned ? 1 : 0;
      result_.forgotten += change == OcclusionCells::Change::kForgotten ? 1 : 0;
      result_.hidden += cells_.hides(x, y, w) ? 1 : 0;
      ++result_.cells;
    }
  }
}

// Only what has visibly come between the background and the camera is the object's surface.
void OcclusionLearner::Impl::learn_surface(Object& object, const CellReader& frame) {
  const ObjectProjection& projection = object.projection;
  const CellRect& rect = projection.rect();
  for (int y = rect.top; y < rect.bottom; ++y) {
    for (int x = rect.left; x < rect.right; ++x) {
      const size_t i = projection.at(x, y);
      const float w = projection.depth(i);
      if (!evidence_.shows_object(i) || !background_.known(x, y) || cells_.hides(x, y, w)) continue;
      const CellColor color = frame.at(x, y);
      if (background_.distance(x, y, color) < kInFront) continue;
      const Eigen::Vector3d point =
          projection.object_from_camera() * grid_.point_in_camera(x, y, w);
      object.surface.learn(object.surface.at(point.cast<float>()), color);
    }
  }
}

void OcclusionLearner::Impl::forget_passing(Object& object) {
  const CellRect& before = object.before;
  for (int y = before.top; y < before.bottom; ++y) {
    for (int x = before.left; x < before.right; ++x) {
      if (object.projection.depth_at(x, y) <= 0) cells_.left(x, y);
    }
  }
  object.before = object.projection.rect();
}

void OcclusionLearner::Impl::publish(Time time) {
  CellRect all;
  for (const auto& object : objects_) {
    if (!object->visible || object->projection.rect().empty()) continue;
    const CellRect rect = grid_.grown(object->projection.rect(), kPublishedMargin);
    all = all.empty()
              ? rect
              : CellRect{std::min(all.left, rect.left), std::min(all.top, rect.top),
                         std::max(all.right, rect.right), std::max(all.bottom, rect.bottom)};
  }
  hidden_.reset();
  if (all.empty()) return;
  const auto out = buffers_.get([] { return std::make_unique<OcclusionDepth>(); });
  out->time = time;
  if (cells_.publish(all, *out)) hidden_ = out;
}

void OcclusionLearner::Impl::step(const Frame& frame, std::span<const PoseTrackPtr> tracks) {
  const FrameInfo& info = frame.info();
  if (info.status != FrameStatus::kGood || info.width != camera_.model.width() ||
      info.height != camera_.model.height()) {
    return;
  }
  result_ = {};
  bool all_placed = true;
  for (auto& object : objects_) {
    const auto track = std::find_if(tracks.begin(), tracks.end(), [&](const PoseTrackPtr& t) {
      return t && t->object() == object->known.id;
    });
    all_placed &= place(*object, track == tracks.end() ? nullptr : track->get(), info.capture);
  }
  const CellReader reader(frame.i420());
  if (all_placed) learn_background(reader);
  for (auto& object : objects_) {
    if (object->judged) {
      judge(*object, reader);
      if (!image_changed_) learn_surface(*object, reader);
    }
    forget_passing(*object);
  }
  publish(info.capture);
}

Result<std::unique_ptr<OcclusionLearner>> OcclusionLearner::create(
    const CalibratedCamera& camera, CameraId id, std::vector<OccludableObject> objects) {
  for (const OccludableObject& object : objects) {
    if (object.depth && object.radius > 0 && std::isfinite(object.radius)) continue;
    return make_error(ErrorCode::kInvalidInput, camera.name,
                      "learning what hides objects needs the mesh of each of them");
  }
  return std::unique_ptr<OcclusionLearner>(
      new OcclusionLearner(std::make_unique<Impl>(camera, id, std::move(objects))));
}

OcclusionLearner::OcclusionLearner(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
OcclusionLearner::~OcclusionLearner() = default;

void OcclusionLearner::step(const Frame& frame, std::span<const PoseTrackPtr> tracks) {
  impl_->step(frame, tracks);
}
OcclusionDepthPtr OcclusionLearner::hidden() const { return impl_->hidden(); }
const OcclusionLearner::StepResult& OcclusionLearner::last_step() const {
  return impl_->last_step();
}

}  // namespace sightline
