// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/track/object_tracker.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "observe/track/exposed_frames.hpp"
#include "observe/track/learned_appearance.hpp"
#include "observe/track/model_tracker.hpp"
#include "observe/track/print/flat_print.hpp"
#include "observe/track/second_look.hpp"
#include "observe/track/silhouettes/picture_check.hpp"
#include "observe/track/symmetry/symmetric_evidence.hpp"
#include "observe/track/track_constants.hpp"
#include "observe/track/tracker_camera.hpp"
#include "sightline/base/check.hpp"
#include "sightline/observe/terms/observation_header.hpp"

namespace sightline {
namespace {

using observe::LearnedAppearance;
using observe::ModelTracker;
using observe::OccludingSphere;
using observe::Prediction;
using observe::TrackerCamera;

// Silhouettes of poses that look nearly the same are compared so often, and sooner while the turn
// is not measured well: drawing all of them takes longer than tracking.
constexpr Duration kCompare = std::chrono::milliseconds(200);
constexpr Duration kCompareSoon = std::chrono::milliseconds(60);
constexpr double kWeakTurn = 0.02;  // [rad]
// The image around the object is checked so often: 0.4 ms each.
constexpr Duration kCheckPicture = std::chrono::milliseconds(250);
constexpr Duration kFoundForMost = std::chrono::seconds(1);       // what was found is of use
constexpr Duration kCheckAbsent = std::chrono::milliseconds(60);  // while it is not seen

Status require(bool good, const char* name, const char* range) {
  if (good) return {};
  return make_error(ErrorCode::kInvalidInput, "tracker", "option {} must be {}", name, range);
}

Status check(const TrackerOptions& o) {
  const auto share = [](double v) { return v >= 0 && v < 1; };
  const auto positive = [](const PoseSigma& s) { return s.rotation > 0 && s.translation > 0; };
  SL_RETURN_IF_ERROR(require(o.region_floor_px > 0, "region_floor_px", "positive"));
  SL_RETURN_IF_ERROR(require(o.edge_floor_px > 0, "edge_floor_px", "positive"));
  SL_RETURN_IF_ERROR(require(o.huber > 0, "huber", "positive"));
  SL_RETURN_IF_ERROR(require(o.gamma > 0.2 && o.gamma < 5, "gamma", "between 0.2 and 5"));
  SL_RETURN_IF_ERROR(require(o.max_line_noise_px > 0, "max_line_noise_px", "positive"));
  SL_RETURN_IF_ERROR(require(o.max_edge_noise_px > 0, "max_edge_noise_px", "positive"));
  SL_RETURN_IF_ERROR(require(o.max_texture_noise_px > 0, "max_texture_noise_px", "positive"));
  SL_RETURN_IF_ERROR(require(o.min_edge_step > 0, "min_edge_step", "positive"));
  SL_RETURN_IF_ERROR(require(o.edge_reach_px > 0, "edge_reach_px", "positive"));
  SL_RETURN_IF_ERROR(require(o.learn_distance_px > 0, "learn_distance_px", "positive"));
  SL_RETURN_IF_ERROR(require(positive(o.placing_floor), "placing_floor", "positive"));
  SL_RETURN_IF_ERROR(require(o.region_correlation_px > 0, "region_correlation_px", "positive"));
  SL_RETURN_IF_ERROR(require(o.edge_correlation_px > 0, "edge_correlation_px", "positive"));
  SL_RETURN_IF_ERROR(
      require(o.learning_rate > 0 && o.learning_rate <= 1, "learning_rate", "above 0, at most 1"));
  SL_RETURN_IF_ERROR(require(o.min_lines >= 6, "min_lines", "6 or more"));
  SL_RETURN_IF_ERROR(require(share(o.min_line_share), "min_line_share", "from 0 to below 1"));
  SL_RETURN_IF_ERROR(require(share(o.min_separation), "min_separation", "from 0 to below 1"));
  return require(share(o.min_evidence), "min_evidence", "from 0 to below 1");
}

}  // namespace

class ObjectTracker::Impl {
 public:
  Impl(const CalibratedCamera& camera, CameraId id, std::vector<TrackedObject> objects,
       const TrackerOptions& options, SceneDepth scene)
      : id_(id),
        camera_(std::make_shared<const CalibratedCamera>(camera), options, std::move(scene)),
        frames_(camera.model.width(), camera.model.height()) {
    for (TrackedObject& object : objects) {
      ids_.push_back(object.id);
      states_.push_back(std::make_unique<State>(camera_, id, std::move(object)));
    }
  }

  std::span<const ObjectId> objects() const { return ids_; }
  const TrackResult& last_result(size_t index) const { return states_.at(index)->last; }
  void step(const Frame& frame, std::span<const PoseTrackPtr> tracks,
            std::vector<Observation>& out);
  void note_found(FoundView view);
  Observation propose(const Frame& frame, ObjectId object, const Rigid3& pose,
                      const Matrix6& covariance);

 private:
  struct State {
    State(const TrackerCamera& camera, CameraId id, TrackedObject tracked)
        : object(std::move(tracked)), tracker(camera, object), appearance(camera, id, object) {
      if (!object.silhouette) return;
      if (object.colors) colors = std::make_unique<observe::ColorComparison>(camera, object);
      picture = std::make_unique<observe::PictureCheck>(camera, object);
      if (object.shape_symmetry.near_rotations.empty()) return;
      silhouettes = std::make_unique<observe::SilhouetteComparison>(camera, object);
    }
    const TrackedObject object;
    ModelTracker tracker;
    LearnedAppearance appearance;
    /// Null: no other pose looks nearly the same.
    std::unique_ptr<observe::SilhouetteComparison> silhouettes;
    /// Null: the mesh has one color, or no other pose looks nearly the same.
    std::unique_ptr<observe::ColorComparison> colors;
    Time compared{};                                 ///< silhouettes and colors, last
    std::unique_ptr<observe::PictureCheck> picture;  ///< null: without silhouettes
    Time checked{};                                  ///< the picture, last
    observe::FlatPrint flat_print;
    std::optional<FoundView> found;  ///< not made use of yet
    TrackResult last;
  };

  bool usable(const Frame& frame) const {
    const CameraModel& model = camera_.camera->model;
    return frame.info().status == FrameStatus::kGood && frame.info().width == model.width() &&
           frame.info().height == model.height();
  }
  /// Appearance from where a search has found the object, if that is asked for.
  void initialize(State& state, const PoseAt& at, Time now);
  void gather_occluders(ObjectId object, Time time, std::span<const PoseTrackPtr> tracks);
  static void check_picture(State& state, const Frame& frame, const Rigid3& pose, Observation& out);
  ModelTracker::Measurement measure(State& state, const Frame& frame, const PoseAt& at,
                                    const PoseEstimate& newest,
                                    const ModelTracker::Learned& learned,
                                    std::vector<PoseTermPtr>& terms);
  void track(State& state, const Frame& frame, const PoseAt& at, const PoseEstimate& newest,
             Observation& out);

  CameraId id_;
  const TrackerCamera camera_;
  std::vector<ObjectId> ids_;
  std::vector<std::unique_ptr<State>> states_;
  std::vector<OccludingSphere> spheres_;
  observe::ExposedFrames frames_;
};

void ObjectTracker::Impl::gather_occluders(ObjectId object, Time time,
                                           std::span<const PoseTrackPtr> tracks) {
  spheres_.clear();
  for (const auto& state : states_) {
    const TrackedObject& other = state->object;
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

// Now and then: does the image show the whole object, and no more of it? An object that is not
// seen where it has to be is missing altogether.
void ObjectTracker::Impl::check_picture(State& state, const Frame& frame, const Rigid3& pose,
                                        Observation& out) {
  const Time now = frame.info().capture;
  const Duration pause = state.last.seen ? kCheckPicture : kCheckAbsent;
  if (!state.picture || now - state.checked < pause) return;
  state.checked = now;
  const observe::ColorReader image(frame.i420());
  const observe::Occluders& occluders = state.tracker.outline().occluders();
  if (state.last.seen) {
    // Before colors: what is printed on the object is told from anything else.
    out.picture = state.tracker.print_missing() ? PictureAgreement{0, 1}
                                                : state.picture->examine(image, pose, occluders);
  } else if (state.picture->must_show(image, pose, occluders)) {
    out.picture = PictureAgreement{0, 1};
  }
}

void ObjectTracker::Impl::note_found(FoundView view) {
  const auto at = std::find(ids_.begin(), ids_.end(), view.object);
  if (at == ids_.end() || !view.frame || !usable(*view.frame)) return;
  states_[static_cast<size_t>(at - ids_.begin())]->found = std::move(view);
}

void ObjectTracker::Impl::initialize(State& state, const PoseAt& at, Time now) {
  if (!state.found) return;
  const FoundView& found = *state.found;
  const bool recent = now - found.frame->info().capture <= kFoundForMost;
  if (recent && (found.refutes || !state.appearance.known())) {
    const Rigid3 pose = camera_.camera_from_world.inverse() * found.camera_from_object;
    const Rigid3& in_force = at.estimate.world_from_object;
    const double turn = state.object.views->angle_up_to_symmetry(pose, in_force);
    // What it refutes is in force until the estimator has heard of it.
    if (found.refutes && turn > observe::tuning::kSymmetricJump) return;
    const size_t aspect = state.tracker.place(pose, spheres_);
    state.appearance.initialize(*frames_.show_like(found.frame), state.tracker.outline(), aspect);
  }
  state.found.reset();
}

// Around where it is predicted, and where that calls for it around where it was.
ModelTracker::Measurement ObjectTracker::Impl::measure(State& state, const Frame& frame,
                                                       const PoseAt& at, const PoseEstimate& newest,
                                                       const ModelTracker::Learned& learned,
                                                       std::vector<PoseTermPtr>& terms) {
  const bool ambiguous = (at.estimate.degraded_reasons & kAmbiguous) != 0;
  const Prediction predicted{at.estimate.world_from_object, at.estimate.own_covariance(), ambiguous,
                             at.estimate.twist};
  const auto look = [&](const Prediction& around) {
    terms.clear();
    return state.tracker.measure(frame, around, learned, spheres_, terms);
  };
  const ModelTracker::Measurement first = look(predicted);
  if (at.source != PoseSource::kPredicted || !observe::calls_for_second_look(predicted, first)) {
    return first;
  }
  const auto was =
      observe::where_it_was(newest, frame.info().capture, state.object.views->radius(), ambiguous);
  if (!was) return first;
  const ModelTracker::Measurement second = look(*was);
  if (observe::agreement(second.result) > observe::agreement(first.result)) return second;
  if (first.result.seen) return look(predicted);  // terms and outline as they were
  terms.clear();
  return first;
}

// Measures an object around its predicted pose and notes what may be learned from the frame.
// `newest`: the last estimate of its track.
void ObjectTracker::Impl::track(State& state, const Frame& frame, const PoseAt& at,
                                const PoseEstimate& newest, Observation& out) {
  LearnedAppearance& appearance = state.appearance;
  const bool ambiguous = (at.estimate.degraded_reasons & kAmbiguous) != 0;
  const bool certain = appearance.certain();
  const bool missing = appearance.misses_object(at.estimate);
  if (missing) appearance.restart_miss_count();
  const bool stale = missing && appearance.known();
  // Colors that were learned of a symmetric pose would mislead.
  const bool fresh_colors = stale || (ambiguous && certain);
  const ModelTracker::Measurement measured =
      measure(state, frame, at, newest,
              {fresh_colors ? nullptr : &appearance.colors(),
               fresh_colors ? nullptr : &appearance.local_colors(), appearance.texture(),
               !fresh_colors && appearance.from_detection()},
              out.terms);
  const bool learned = state.last.learned;
  state.last = measured.result;
  state.last.learned = learned;
  // So many of its points in place are a print that is there, however it looks as a whole.
  if (state.last.seen && state.object.printed && !observe::print_in_place(state.last) &&
      observe::print_agreement(frame, measured.fitted, camera_, state.object) <
          observe::tuning::kPrintRefuted) {
    state.last.seen = false;  // an outline that fits something else, or too little of the object
    out.terms.clear();
  }
  check_picture(state, frame, state.last.seen ? measured.fitted : at.estimate.world_from_object,
                out);
  if (!state.last.seen) {
    appearance.note_missed(at.estimate);
    return;
  }
  if (state.last.by_print) {
    out.print =
        state.flat_print.judge(frame.info().capture, measured.fitted, state.tracker.print_found(),
                               2 * state.object.views->radius(), camera_.camera_from_world);
  }
  const observe::PlacedOutline& outline = state.tracker.outline();
  const bool weak = at.estimate.own_sigma_rotation() > kWeakTurn;
  const Duration pause = ambiguous || weak ? kCompareSoon : kCompare;
  // A print says by itself which side is which.
  const bool by_colors = state.colors && (ambiguous || !state.object.printed);
  const bool compare =
      (state.silhouettes || by_colors) && frame.info().capture - state.compared >= pause;
  if (compare) state.compared = frame.info().capture;
  if (compare || (ambiguous && !state.silhouettes)) {
    out.symmetric_hypotheses = observe::compare_symmetric_poses(
        frame, measured.fitted, camera_, state.object, outline.occluders(),
        certain ? appearance.texture() : nullptr, compare ? state.silhouettes.get() : nullptr,
        compare && by_colors ? state.colors.get() : nullptr);
  }
  if (state.last.by_print_alone) return;
  appearance.note_seen(frame, outline, measured.aspect, measured.result, stale);
}

void ObjectTracker::Impl::step(const Frame& frame, std::span<const PoseTrackPtr> tracks,
                               std::vector<Observation>& out) {
  if (!usable(frame)) return;
  const Time capture = frame.info().capture;
  const Frame* shown = nullptr;  // made once somebody looks
  for (auto& owned : states_) {
    State& state = *owned;
    state.last = {};
    const ObjectId object = state.object.id;
    Observation& observation = out.emplace_back(make_observation(frame.info(), id_, object));
    const auto found = std::find_if(tracks.begin(), tracks.end(), [object](const PoseTrackPtr& t) {
      return t && t->object() == object;
    });
    if (found == tracks.end() || (*found)->empty()) continue;
    const bool learned = state.appearance.learn_pending(**found, state.tracker.outline());
    const PoseAt at = (*found)->at(capture);
    state.appearance.review(at, state.tracker.outline().pose());
    if (at.source == PoseSource::kNone || !has_pose(at.estimate.state)) continue;
    state.last.learned = learned;
    gather_occluders(object, capture, tracks);
    if (shown == nullptr) shown = &frames_.show(frame);
    initialize(state, at, capture);
    track(state, *shown, at, (*found)->newest(), observation);
  }
}

Observation ObjectTracker::Impl::propose(const Frame& frame, ObjectId object, const Rigid3& pose,
                                         const Matrix6& covariance) {
  Observation out = make_observation(frame.info(), id_, object);
  const auto at = std::find(ids_.begin(), ids_.end(), object);
  if (at == ids_.end() || !usable(frame)) return out;
  State& state = *states_[static_cast<size_t>(at - ids_.begin())];
  spheres_.clear();
  state.last = state.tracker
                   .measure(frames_.show(frame), {pose, covariance},
                            {nullptr, nullptr, state.appearance.texture()}, spheres_, out.terms)
                   .result;
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
  std::erase_if(objects,
                [](const TrackedObject& object) { return !object.modalities.appearance(); });
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

void ObjectTracker::note_found(FoundView view) { impl_->note_found(std::move(view)); }

Observation ObjectTracker::propose(const Frame& frame, ObjectId object,
                                   const Rigid3& world_from_object, const Matrix6& covariance) {
  return impl_->propose(frame, object, world_from_object, covariance);
}

const ObjectTracker::TrackResult& ObjectTracker::last_result(size_t index) const {
  return impl_->last_result(index);
}

}  // namespace sightline
