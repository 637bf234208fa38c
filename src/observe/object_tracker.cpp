// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/object_tracker.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "object_look.hpp"
#include "sightline/base/check.hpp"

namespace sightline {
namespace {

using observe::HidingSphere;
using observe::LookAt;
using observe::LookCamera;
using observe::ObjectLook;

// Colours are learned only if the estimate of that frame lies where they were read.
constexpr double kSameOutlinePx = 2.0;
// Points of texture stay where the pose puts them: it has to be known [rad, m].
// An estimate that turns more than this from one frame to the next was moved to another pose that
// looks alike [rad].
constexpr double kOtherPose = 0.7;
// A camera that misses what the others see, so many frames in a row, has colours that are no longer
// true: it looks with those of the frame itself, from time to time.
constexpr int kBlindFrames = 5;
constexpr double kPlacedRotation = 0.10, kPlacedTranslation = 0.03;
constexpr double kSureRotation = 0.010, kSureTranslation = 0.004;

Status require(bool good, const char* name, const char* range) {
  if (good) return {};
  return make_error(ErrorCode::kInvalidInput, "tracker", "option {} must be {}", name, range);
}

Status check(const TrackerOptions& o) {
  const auto share = [](double v) { return v >= 0 && v < 1; };
  SL_RETURN_IF_ERROR(require(o.region_floor_px > 0, "region_floor_px", "positive"));
  SL_RETURN_IF_ERROR(require(o.edge_floor_px > 0, "edge_floor_px", "positive"));
  SL_RETURN_IF_ERROR(require(o.huber > 0, "huber", "positive"));
  SL_RETURN_IF_ERROR(require(o.gamma > 0.2 && o.gamma < 5, "gamma", "between 0.2 and 5"));
  SL_RETURN_IF_ERROR(require(o.region_correlation_px > 0, "region_correlation_px", "positive"));
  SL_RETURN_IF_ERROR(require(o.edge_correlation_px > 0, "edge_correlation_px", "positive"));
  SL_RETURN_IF_ERROR(
      require(o.learning_rate > 0 && o.learning_rate <= 1, "learning_rate", "above 0, at most 1"));
  SL_RETURN_IF_ERROR(require(o.min_lines >= 6, "min_lines", "6 or more"));
  SL_RETURN_IF_ERROR(require(share(o.min_line_share), "min_line_share", "from 0 to below 1"));
  SL_RETURN_IF_ERROR(require(share(o.min_separation), "min_separation", "from 0 to below 1"));
  return require(share(o.min_evidence), "min_evidence", "from 0 to below 1");
}

Observation nothing_seen(const Frame& frame, CameraId camera, ObjectId object) {
  const FrameInfo& info = frame.info();
  Observation out;
  out.object = object;
  out.camera = camera;
  out.epoch = info.epoch;
  out.sequence = info.sequence;
  out.capture = info.capture;
  out.capture_error = info.capture_error;
  return out;
}

// Well enough for an outline to be looked for where it must be.
bool held_by_others(const PoseEstimate& estimate) {
  constexpr Doubts kFewer = kWeakPosition | kOneCamera;  // as one camera alone is
  const bool held = estimate.state == TrackState::kTracking ||
                    (estimate.state == TrackState::kDegraded && (estimate.doubts & ~kFewer) == 0);
  return held && estimate.own_sigma_rotation() < kPlacedRotation &&
         estimate.own_sigma_translation() < kPlacedTranslation;
}

bool only_ambiguous(const PoseEstimate& estimate) {
  return estimate.state == TrackState::kDegraded && estimate.doubts == kAmbiguous;
}

}  // namespace

class ObjectTracker::Impl {
 public:
  Impl(const CalibratedCamera& camera, CameraId id, std::vector<TrackedObject> objects,
       const TrackerOptions& options, SceneDepth scene)
      : id_(id),
        camera_{std::make_shared<const CalibratedCamera>(camera),
                camera.world_from_camera.inverse(), options, std::move(scene),
                observe::LightTable(options.gamma)} {
    for (TrackedObject& object : objects) {
      ids_.push_back(object.id);
      states_.push_back(std::make_unique<State>(camera_, std::move(object)));
    }
  }

  std::span<const ObjectId> objects() const { return ids_; }
  const Look& last_look(size_t index) const { return states_.at(index)->last; }
  void step(const Frame& frame, std::span<const PoseTrackPtr> tracks,
            std::vector<Observation>& out);
  Observation propose(const Frame& frame, ObjectId object, const Rigid3& pose,
                      const Matrix6& covariance);

 private:
  struct State {
    State(const LookCamera& camera, TrackedObject object) : look(camera, std::move(object)) {}
    ObjectLook look;
    Look last;
    // Colours of the newest frame, until its estimate is known.
    bool pending = false;
    Time pending_capture{};
    /// What was learned belongs to a pose that may be another: it says nothing of which it is.
    bool provisional = false;
    int missed = 0;        ///< frames in a row in which others saw it
    bool relearn = false;  ///< the pending colours take the place of those that were learned
    size_t pending_side = 0;
    std::vector<uint16_t> foreground, background;
  };

  bool usable(const Frame& frame) const {
    const CameraModel& model = camera_.camera->model;
    return frame.info().status == FrameStatus::kGood && frame.info().width == model.width() &&
           frame.info().height == model.height();
  }
  void review_provisional(State& state, const PoseAt& at);
  bool colours_are_stale(State& state, const PoseEstimate& estimate) const;
  bool learn_pending(State& state, const PoseTrack& track);
  void gather_hiders(ObjectId object, Time time, std::span<const PoseTrackPtr> tracks);

  CameraId id_;
  LookCamera camera_;
  std::vector<ObjectId> ids_;
  std::vector<std::unique_ptr<State>> states_;
  std::vector<HidingSphere> spheres_;
};

// Provisional knowledge becomes sure when the pose does, and worthless when the object is lost or
// turns out to lie another way.
void ObjectTracker::Impl::review_provisional(State& state, const PoseAt& at) {
  if (!state.provisional) return;
  const bool there = at.source != PoseSource::kNone && has_pose(at.estimate.state);
  if (!there || rotation_angle(at.estimate.world_from_object, state.look.fitted()) > kOtherPose) {
    state.look.forget_learned();
    state.provisional = false;
  } else if (at.estimate.state == TrackState::kTracking) {
    state.provisional = false;
  }
}

// A camera that for some frames did not see, or was refused, what the others hold looks with the
// colours of the frame itself now and then.
bool ObjectTracker::Impl::colours_are_stale(State& state, const PoseEstimate& estimate) const {
  if (state.missed < kBlindFrames || !held_by_others(estimate)) return false;
  state.missed = 0;
  return state.look.learned();
}

bool ObjectTracker::Impl::learn_pending(State& state, const PoseTrack& track) {
  const bool relearn = std::exchange(state.relearn, false);
  if (!std::exchange(state.pending, false)) return false;
  const PoseAt at = track.at(state.pending_capture);
  const bool counted = (at.estimate.cameras & camera_bit(id_)) != 0;
  if (at.source == PoseSource::kEstimated && has_pose(at.estimate.state)) {
    state.missed = counted ? 0 : state.missed + (held_by_others(at.estimate) ? 1 : 0);
  }
  const bool ambiguous = only_ambiguous(at.estimate);
  // What is sure must not be mixed with what may be the other way round.
  const bool wanted = at.estimate.state == TrackState::kTracking ||
                      (ambiguous && (state.provisional || !state.look.learned()));
  if (at.source != PoseSource::kEstimated || !wanted || !counted ||
      state.look.outline_distance(at.estimate.world_from_object) > kSameOutlinePx) {
    state.look.drop_texture();
    return false;
  }
  state.provisional |= ambiguous;
  if (at.estimate.own_sigma_rotation() < kSureRotation &&
      at.estimate.own_sigma_translation() < kSureTranslation) {
    state.look.keep_texture(at.estimate.world_from_object);
  } else {
    state.look.drop_texture();
  }
  if (relearn) state.look.appearance().forget();
  return state.look.appearance().learn(state.pending_side, state.foreground, state.background,
                                       static_cast<float>(camera_.options.learning_rate));
}

void ObjectTracker::Impl::gather_hiders(ObjectId object, Time time,
                                        std::span<const PoseTrackPtr> tracks) {
  spheres_.clear();
  for (const auto& state : states_) {
    const TrackedObject& other = state->look.object();
    if (other.id == object) continue;
    for (const PoseTrackPtr& track : tracks) {
      if (!track || track->object() != other.id || track->empty()) continue;
      const PoseAt at = track->at(time);
      if (at.source == PoseSource::kNone) continue;
      spheres_.push_back(
          {camera_.camera_from_world * (at.estimate.world_from_object * other.views->center()),
           other.views->radius()});
    }
  }
}

void ObjectTracker::Impl::step(const Frame& frame, std::span<const PoseTrackPtr> tracks,
                               std::vector<Observation>& out) {
  if (!usable(frame)) return;
  const Time capture = frame.info().capture;
  for (auto& owned : states_) {
    State& state = *owned;
    state.last = {};
    const ObjectId object = state.look.object().id;
    Observation& observation = out.emplace_back(nothing_seen(frame, id_, object));
    const auto track = std::find_if(tracks.begin(), tracks.end(), [object](const PoseTrackPtr& t) {
      return t && t->object() == object;
    });
    if (track == tracks.end() || (*track)->empty()) continue;
    const bool learned = learn_pending(state, **track);
    const PoseAt at = (*track)->at(capture);
    review_provisional(state, at);
    if (at.source == PoseSource::kNone || !has_pose(at.estimate.state)) continue;
    gather_hiders(object, capture, tracks);
    const bool ambiguous = (at.estimate.doubts & kAmbiguous) != 0;
    const bool sure_before = state.look.learned() && !state.provisional;
    const bool stale = colours_are_stale(state, at.estimate);
    // Colours that were learned of another side would mislead.
    state.look.measure(frame,
                       {at.estimate.world_from_object, at.estimate.own_covariance(), ambiguous},
                       stale || (ambiguous && sure_before), spheres_, observation.terms);
    state.relearn = stale && state.look.look().seen;
    state.last = state.look.look();
    state.last.learned = learned;
    if (!state.last.seen) {
      state.missed += held_by_others(at.estimate) ? 1 : 0;
      continue;
    }
    if (ambiguous) state.look.compare_sides(frame, sure_before, observation.alike);
    state.look.collect(frame, state.foreground, state.background);
    state.look.note_texture(frame);
    state.pending = true;
    state.pending_capture = capture;
    state.pending_side = state.look.side();
  }
}

Observation ObjectTracker::Impl::propose(const Frame& frame, ObjectId object, const Rigid3& pose,
                                         const Matrix6& covariance) {
  Observation out = nothing_seen(frame, id_, object);
  const auto at = std::find(ids_.begin(), ids_.end(), object);
  if (at == ids_.end() || !usable(frame)) return out;
  State& state = *states_[static_cast<size_t>(at - ids_.begin())];
  spheres_.clear();
  state.look.measure(frame, {pose, covariance}, true, spheres_, out.terms);
  state.last = state.look.look();
  if (out.terms.empty()) return out;
  double cost = 0;
  for (const PoseTermPtr& term : out.terms) cost += term->linearize(pose).cost;
  out.hypotheses.push_back({pose, cost});
  return out;
}

Result<std::unique_ptr<ObjectTracker>> ObjectTracker::create(const CalibratedCamera& camera,
                                                             CameraId id,
                                                             std::vector<TrackedObject> objects,
                                                             const TrackerOptions& options,
                                                             SceneDepth scene) {
  SL_RETURN_IF_ERROR(check(options));
  std::erase_if(objects, [](const TrackedObject& object) { return !object.cues.look(); });
  for (const TrackedObject& object : objects) {
    SL_CHECK(object.views != nullptr, "a tracked object has a viewpoint model");
  }
  return std::unique_ptr<ObjectTracker>(new ObjectTracker(
      std::make_unique<Impl>(camera, id, std::move(objects), options, std::move(scene))));
}

ObjectTracker::ObjectTracker(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ObjectTracker::~ObjectTracker() = default;

std::span<const ObjectId> ObjectTracker::objects() const { return impl_->objects(); }

void ObjectTracker::step(const Frame& frame, std::span<const PoseTrackPtr> tracks,
                         std::vector<Observation>& out) {
  impl_->step(frame, tracks, out);
}

Observation ObjectTracker::propose(const Frame& frame, ObjectId object,
                                   const Rigid3& world_from_object, const Matrix6& covariance) {
  return impl_->propose(frame, object, world_from_object, covariance);
}

const ObjectTracker::Look& ObjectTracker::last_look(size_t index) const {
  return impl_->last_look(index);
}

}  // namespace sightline
