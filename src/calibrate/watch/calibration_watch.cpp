// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/calibration_watch.hpp"

#include <Eigen/Cholesky>
#include <algorithm>

#include "calibrate/watch/camera_evidence.hpp"
#include "calibrate/watch/look_rounds.hpp"
#include "calibrate/watch/scene_evidence.hpp"
#include "sightline/base/check.hpp"

namespace sightline {

using calibrate::CameraEvidence;
using calibrate::ChangedTogether;
using calibrate::Correction;
using calibrate::CorrectionFit;
using calibrate::CourseFit;
using calibrate::LookRound;
using calibrate::LookRounds;
using calibrate::RoundComparison;
using calibrate::SceneEvidence;

namespace {
constexpr double kDisputed = 0.8;     // of the largest gain: nobody tells which is wrong
constexpr double kRestored = 10;      // significance below which a flagged camera is in order again
constexpr double kMargin = 10;        // of the gain; less may be chance
constexpr int kDisputedBuckets = 10;  // before a dispute is one
constexpr size_t kRecent = 15;        // buckets that tell so
constexpr size_t kFewestBuckets = 5;  // before anything is said
constexpr size_t kFewest = 2;         // buckets that a correction is made of
// One sigma of a look at an object, where there was none [rad, m].
constexpr double kLookRotation = 0.002, kLookTranslation = 0.002;
constexpr double kAnywhere = 1;  // of a camera that is another one [rad, m]
const std::shared_ptr<const Matrix6> kNothing;

}  // namespace

std::string_view to_string(CalibrationState state) {
  switch (state) {
    case CalibrationState::kUnknown:
      return "unknown";
    case CalibrationState::kInOrder:
      return "in_order";
    case CalibrationState::kKnocked:
      return "knocked";
    case CalibrationState::kDrifting:
      return "drifting";
    case CalibrationState::kDisputed:
      return "disputed";
    case CalibrationState::kUnfit:
      return "unfit";
  }
  return "";
}

struct CalibrationWatch::Impl {
  struct Candidate {
    CourseFit course;
    double gain = 0;    // of it, without the variance factor
    int confirmed = 0;  // buckets in which it was the one to blame
  };

  void compare(const LookRound& round, size_t object, const PoseTrack& track);
  void close_bucket(Time now);
  void judge_flagged(size_t camera);
  void find_culprit(Time now);
  void flag(size_t camera, Time now);
  void restore(size_t camera);
  void describe(size_t camera);
  bool add_scene(const SceneLook& look);
  void flag_by_scene(size_t camera, Time now);
  void set_unfit(size_t camera, Time now);
  bool is_light(size_t camera, Time now);
  CorrectionFit with_scene(size_t camera, Vector6& rate) const;
  void resize();
  void reset();

  CalibrationWatchOptions options;
  std::vector<std::optional<Rigid3>> world_from_camera;
  std::vector<ShapeSymmetry> shape_symmetry;  // by ObjectId
  std::vector<LookRounds> rounds;             // by ObjectId
  RoundComparison comparison;
  std::vector<CameraEvidence> evidence;  // by CameraId, as all below
  std::vector<SceneEvidence> scenes;
  ChangedTogether changed;
  std::vector<char> voters;
  std::vector<Candidate> candidates;
  std::vector<CameraWatch> verdicts;
  std::vector<std::shared_ptr<const Matrix6>> extra_covariances;
  int disputed = 0;  // buckets in which more than one camera could be to blame
  Time bucket_end = Time::min();
};

// Starts anew with the cameras that there are.
void CalibrationWatch::Impl::resize() {
  const size_t cameras = world_from_camera.size();
  rounds.clear();
  for (const ShapeSymmetry& symmetry : shape_symmetry) {
    rounds.emplace_back(cameras, options.round, symmetry);
  }
  evidence.assign(cameras, CameraEvidence(options));
  scenes.assign(cameras, SceneEvidence(options));
  voters.resize(cameras);
  candidates.resize(cameras);
  verdicts.resize(cameras);
  extra_covariances.resize(cameras);
  reset();
}

void CalibrationWatch::Impl::reset() {
  for (size_t i = 0; i < evidence.size(); ++i) {
    evidence[i].clear();
    scenes[i].clear();
    voters[i] = world_from_camera[i] ? 1 : 0;
    candidates[i] = Candidate();
    verdicts[i] = CameraWatch();
    extra_covariances[i].reset();
  }
  for (LookRounds& r : rounds) r.clear();
  changed.begin(evidence.size());
  disputed = 0;
  bucket_end = Time::min();
}

void CalibrationWatch::Impl::compare(const LookRound& round, size_t, const PoseTrack& track) {
  if (!comparison.load(round, track)) return;
  Correction correction;
  for (size_t camera = 0; camera < evidence.size(); ++camera) {
    if (!world_from_camera[camera] || !comparison.has(camera)) continue;
    if (!comparison.compare(camera, *world_from_camera[camera], voters, correction)) continue;
    evidence[camera].add(round.looks[camera].time, correction, comparison.world_from_object());
  }
}

void CalibrationWatch::Impl::close_bucket(Time now) {
  for (size_t i = 0; i < evidence.size(); ++i) {
    evidence[i].close();
    if (is_wrong(verdicts[i].state)) judge_flagged(i);
  }
  find_culprit(now);
  for (size_t i = 0; i < evidence.size(); ++i) describe(i);
}

// Is it still off, by as much?
void CalibrationWatch::Impl::judge_flagged(size_t camera) {
  CameraEvidence& own = evidence[camera];
  if (own.size() < kRecent) return;
  const auto recent = own.fit_newest(kRecent);
  const CameraWatch& verdict = verdicts[camera];
  if (recent.significance < kRestored && own.begin(own.size() - kRecent) >= verdict.flagged &&
      !scenes[camera].moved()) {
    restore(camera);
    return;
  }
  const Vector6 change = recent.correction - verdict.correction;
  const double squared = change.dot((recent.covariance + verdict.covariance).ldlt().solve(change));
  if (verdict.state == CalibrationState::kKnocked && squared > options.significance) {
    own.forget_before(kRecent);  // knocked again
  }
}

// A wrong camera makes those look wrong that are compared with it, but its own correction explains
// the most.
void CalibrationWatch::Impl::find_culprit(Time now) {
  const size_t none = evidence.size();
  size_t worst = none;
  double second = 0, scale = 1;
  for (size_t i = 0; i < evidence.size(); ++i) {
    if (voters[i] == 0) continue;
    const bool enough = evidence[i].size() >= kFewestBuckets;
    verdicts[i].state =
        enough || scenes[i].enough() ? CalibrationState::kInOrder : CalibrationState::kUnknown;
    if (!enough) continue;
    candidates[i].course = evidence[i].fit_course();
    // Of one scale for all, as they are compared.
    const double gain = candidates[i].gain = candidates[i].course.gain * evidence[i].scale();
    scale = std::max(scale, evidence[i].scale());
    if (worst != none && gain <= candidates[worst].gain) {
      second = std::max(second, gain);
      continue;
    }
    if (worst != none) second = std::max(second, candidates[worst].gain);
    worst = i;
  }
  for (size_t i = 0; i < candidates.size(); ++i) {
    if (i != worst) candidates[i].confirmed = 0;
  }
  const bool found =
      worst != none && candidates[worst].course.now.significance > options.significance;
  if (!found) {
    disputed = 0;
    if (worst != none) candidates[worst].confirmed = 0;
    return;
  }
  const double gain = candidates[worst].gain;
  if (second <= kDisputed * gain && second + kMargin * scale <= gain) {
    disputed = 0;
    if (++candidates[worst].confirmed >= options.confirm_buckets) flag(worst, now);
    return;
  }
  candidates[worst].confirmed = 0;
  if (++disputed < kDisputedBuckets) return;
  for (size_t i = 0; i < evidence.size(); ++i) {
    const bool may_be = voters[i] != 0 && evidence[i].size() >= kFewestBuckets &&
                        candidates[i].gain >= std::min(kDisputed * gain, gain - kMargin * scale);
    if (may_be) verdicts[i].state = CalibrationState::kDisputed;
  }
}

void CalibrationWatch::Impl::flag(size_t camera, Time now) {
  const CourseFit course = candidates[camera].course;
  CameraWatch& verdict = verdicts[camera];
  CameraEvidence& own = evidence[camera];
  verdict.state = course.ramp ? CalibrationState::kDrifting : CalibrationState::kKnocked;
  verdict.since = own.begin(course.from);
  verdict.since_start = course.from == 0 && !course.ramp;
  verdict.flagged = now;
  voters[camera] = 0;
  candidates[camera] = Candidate();
  // What others were compared with was wrong since then.
  for (size_t i = 0; i < evidence.size(); ++i) {
    if (i != camera) evidence[i].forget_since(verdict.since);
  }
  // The bucket of the knock itself is of both places.
  if (!course.ramp && course.from > 0) {
    own.forget_before(std::max(kFewest, own.size() - course.from - 1));
  }
  verdict.correction = course.now.correction;
  verdict.covariance = course.now.covariance;
}

void CalibrationWatch::Impl::restore(size_t camera) {
  evidence[camera].forget_before(kRecent);
  voters[camera] = 1;
  verdicts[camera] = CameraWatch();
}

// What the room says and what the objects say, if anything, of a camera that stands elsewhere.
CorrectionFit CalibrationWatch::Impl::with_scene(size_t camera, Vector6& rate) const {
  CorrectionFit fit = scenes[camera].correction(rate);
  const CameraEvidence& own = evidence[camera];
  if (own.size() < kFewest) return fit;
  const size_t newest = scenes[camera].drifts() ? kRecent : own.size();
  const CorrectionFit objects = own.fit_newest(newest);
  // The prior is in both; that of a shift is far too wide to matter.
  const Matrix6 information = fit.covariance.ldlt().solve(Matrix6::Identity());
  const Matrix6 of_objects = objects.covariance.ldlt().solve(Matrix6::Identity());
  const Eigen::LDLT<Matrix6> both(Matrix6(information + of_objects));
  fit.correction = both.solve(information * fit.correction + of_objects * objects.correction);
  fit.covariance = both.solve(Matrix6::Identity());
  fit.significance = std::max(fit.significance, objects.significance);
  return fit;
}

void CalibrationWatch::Impl::describe(size_t camera) {
  CameraWatch& verdict = verdicts[camera];
  const CameraEvidence& own = evidence[camera];
  verdict.compared_s = static_cast<double>(own.rounds()) * to_seconds(options.round);
  verdict.patches = scenes[camera].newest().patches;
  verdict.looked = scenes[camera].newest().time;
  if (verdict.state == CalibrationState::kUnfit) return;
  if (own.size() == 0 && !verdict.by_scene) {
    extra_covariances[camera].reset();
    return;
  }
  const bool wrong = is_wrong(verdict.state);
  CourseFit course;
  if (wrong && verdict.by_scene) {
    course.now = with_scene(camera, course.rate);
  } else if (verdict.state == CalibrationState::kDrifting) {
    course = own.fit_course();
  } else if (wrong || verdict.state == CalibrationState::kInOrder) {
    course.now = own.fit_newest(own.size());
  } else {
    course = own.fit_course();
  }
  verdict.correction = course.now.correction;
  verdict.covariance = course.now.covariance;
  verdict.significance = course.now.significance;
  verdict.rate = course.rate;
  if (verdict.state == CalibrationState::kDisputed) verdict.since = own.begin(course.from);
  if (!wrong) {
    verdict.vote = 1;
    if (verdict.state != CalibrationState::kDisputed) verdict.since = verdict.flagged = Time();
    extra_covariances[camera].reset();
    return;
  }
  const Matrix6 moments = verdict.correction * verdict.correction.transpose() + verdict.covariance;
  extra_covariances[camera] =
      std::make_shared<const Matrix6>(world_from_camera[camera]->covariance_in_target(moments));
  Matrix6 look = own.round_information();
  if (own.size() == 0) {
    Vector6 usual;
    usual << Eigen::Vector3d::Constant(1 / (kLookRotation * kLookRotation)),
        Eigen::Vector3d::Constant(1 / (kLookTranslation * kLookTranslation));
    look = usual.asDiagonal();
  }
  verdict.vote = 6 / (6 + verdict.correction.dot(look * verdict.correction));
  verdict.look_ratio = (look * verdict.covariance).trace() / 6;
}

bool CalibrationWatch::Impl::add_scene(const SceneLook& look) {
  const size_t camera = look.camera.index();
  if (camera >= scenes.size() || !world_from_camera[camera]) return false;
  CameraWatch& verdict = verdicts[camera];
  switch (scenes[camera].add(look)) {
    case SceneEvidence::Event::kNone:
      return false;
    case SceneEvidence::Event::kBucket:
      break;
    case SceneEvidence::Event::kMoved:
      flag_by_scene(camera, look.time);
      break;
    case SceneEvidence::Event::kUnfit:
      set_unfit(camera, look.time);
      break;
    case SceneEvidence::Event::kBack:
      verdict.by_scene = false;
      [[fallthrough]];
    case SceneEvidence::Event::kFits:
      changed.forget(camera);
      evidence[camera].forget_before(0);
      voters[camera] = 1;
      verdict = CameraWatch();
      extra_covariances[camera].reset();
      break;
  }
  if (verdict.state == CalibrationState::kUnknown && scenes[camera].enough()) {
    verdict.state = CalibrationState::kInOrder;
  }
  describe(camera);
  return true;
}

// The room is no party: it needs no comparison with other cameras.
void CalibrationWatch::Impl::flag_by_scene(size_t camera, Time now) {
  CameraWatch& verdict = verdicts[camera];
  const SceneEvidence& scene = scenes[camera];
  verdict.by_scene = true;
  disputed = 0;
  if (is_wrong(verdict.state)) return;  // the objects said so
  verdict.state = scene.drifts() ? CalibrationState::kDrifting : CalibrationState::kKnocked;
  verdict.since = scene.since();
  verdict.since_start = scene.since_start();
  verdict.flagged = now;
  voters[camera] = 0;
  candidates[camera] = Candidate();
  for (size_t i = 0; i < evidence.size(); ++i) {
    if (i != camera) {
      evidence[i].forget_since(verdict.since);
      if (verdicts[i].state == CalibrationState::kDisputed) {
        verdicts[i].state = CalibrationState::kUnknown;
      }
    } else if (!verdict.since_start) {
      evidence[i].forget_until(verdict.since);
    }
  }
}

// All of them are not another camera's; the objects still tell.
bool CalibrationWatch::Impl::is_light(size_t camera, Time now) {
  const SceneLook& look = scenes[camera].newest();
  changed.forget(camera);
  if (look.zoom != 1 || !look.looks_like.empty()) return false;
  changed.note(camera, now);
  if (!changed.are_most(scenes, now)) return false;
  for (size_t i = 0; i < verdicts.size(); ++i) {
    if (!changed.has(i, now)) continue;
    voters[i] = 1;
    verdicts[i] = CameraWatch{.light_changed = true};
    extra_covariances[i].reset();
  }
  return true;
}

void CalibrationWatch::Impl::set_unfit(size_t camera, Time now) {
  if (is_light(camera, now)) return;
  CameraWatch& verdict = verdicts[camera];
  const SceneEvidence& scene = scenes[camera];
  verdict.zoom = scene.newest().zoom;
  verdict.looks_like = scene.newest().looks_like;
  if (verdict.state == CalibrationState::kUnfit) return;
  verdict = {.state = CalibrationState::kUnfit,
             .since = scene.since(),
             .flagged = now,
             .vote = 0,
             .by_scene = true,
             .zoom = verdict.zoom,
             .looks_like = verdict.looks_like};
  voters[camera] = 0;
  candidates[camera] = Candidate();
  extra_covariances[camera] =
      std::make_shared<const Matrix6>(kAnywhere * kAnywhere * Matrix6::Identity());
  for (size_t i = 0; i < evidence.size(); ++i) {
    if (i != camera) evidence[i].forget_since(verdict.since);
  }
}

CalibrationWatch::CalibrationWatch(std::vector<std::optional<Rigid3>> world_from_camera,
                                   std::vector<ShapeSymmetry> shape_symmetry,
                                   const CalibrationWatchOptions& options)
    : impl_(std::make_unique<Impl>()) {
  impl_->options = options;
  impl_->world_from_camera = std::move(world_from_camera);
  impl_->shape_symmetry = std::move(shape_symmetry);
  impl_->resize();
}

CalibrationWatch::~CalibrationWatch() = default;
CalibrationWatch::CalibrationWatch(CalibrationWatch&&) noexcept = default;
CalibrationWatch& CalibrationWatch::operator=(CalibrationWatch&&) noexcept = default;

bool CalibrationWatch::add(const Observation& observation, const PoseTrack& track) {
  Impl& impl = *impl_;
  const size_t object = observation.object.index();
  if (object >= impl.rounds.size() || observation.camera.index() >= impl.evidence.size()) {
    return false;
  }
  const LookRound* complete = impl.rounds[object].add(observation, track);
  if (complete == nullptr) return false;
  impl.compare(*complete, object, track);
  const Time now = observation.capture;
  if (impl.bucket_end == Time::min() || now < impl.bucket_end - 2 * impl.options.bucket) {
    impl.bucket_end = now + impl.options.bucket;
    return false;
  }
  if (now < impl.bucket_end) return false;
  impl.bucket_end = now + impl.options.bucket;
  impl.close_bucket(now);
  return true;
}

bool CalibrationWatch::add(const SceneLook& look) { return impl_->add_scene(look); }

std::span<const CameraWatch> CalibrationWatch::cameras() const { return impl_->verdicts; }

const std::shared_ptr<const Matrix6>& CalibrationWatch::extra_covariance(CameraId camera) const {
  return camera.index() < impl_->extra_covariances.size() ? impl_->extra_covariances[camera.index()]
                                                          : kNothing;
}

void CalibrationWatch::set_cameras(std::vector<std::optional<Rigid3>> world_from_camera) {
  Impl& impl = *impl_;
  if (impl.world_from_camera == world_from_camera) return;
  impl.world_from_camera = std::move(world_from_camera);
  impl.resize();
}

}  // namespace sightline
