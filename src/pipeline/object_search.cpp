// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/object_search.hpp"

#include <algorithm>
#include <utility>

#include "pipeline/search/found_frames.hpp"
#include "sightline/base/log.hpp"
#include "sightline/pipeline/parallel.hpp"
#include "sightline/pipeline/search_cost.hpp"

namespace sightline {
namespace {

constexpr Duration kEager = std::chrono::seconds(10);  // after it went missing: no bound on cost
constexpr Duration kTakenUp = std::chrono::milliseconds(150);  // what is found is tracked by then
constexpr Duration kForgotten = std::chrono::seconds(5);  // without a search: it goes missing anew

// Where its camera looked is known.
bool trusted(const Frame& frame) {
  const CameraPlacePtr& place = frame.info().place;
  return !place || place->trusted();
}

// Null where the mesh has no colors.
Result<std::unique_ptr<ColorVerifier>> make_color_verifier(
    const RigObject& object, const std::vector<DetectorCamera>& cameras) {
  if (!object.samples) return std::unique_ptr<ColorVerifier>();
  return ColorVerifier::create(*object.samples, cameras);
}

}  // namespace

ObjectSearch::ObjectSearch() = default;
ObjectSearch::~ObjectSearch() = default;

void ObjectSearch::offer_to(std::shared_ptr<FoundViews> views) {
  found_frames_ = std::make_unique<pipeline::FoundFrames>(cameras_, std::move(views));
}

Result<std::unique_ptr<ObjectSearch>> ObjectSearch::create(const Installation& installation,
                                                           const Rig& rig) {
  std::unique_ptr<ObjectSearch> search(new ObjectSearch());
  if (!installation.detect.enabled) return std::unique_ptr<ObjectSearch>();
  search->interval_ = installation.detect.interval;
  search->max_load_ = installation.detect.max_load;
  std::vector<DetectorCamera> cameras;
  for (size_t i = 0; i < installation.cameras.size(); ++i) {
    const CameraConfig& camera = installation.cameras[i];
    if (!observes(camera.role)) continue;
    cameras.push_back({CameraId(static_cast<uint32_t>(i)), camera.calibration});
    // A background is learned pixel by pixel: that of a camera that turns never stands still.
    if (!installation.detect.silhouettes || camera.calibration.axes) continue;
    search->backgrounds_.resize(installation.cameras.size());
    SL_ASSIGN(search->backgrounds_[i],
              BackgroundModel::create(camera.calibration, installation.detect.background));
  }
  if (cameras.empty()) return std::unique_ptr<ObjectSearch>();
  search->cameras_ = cameras;
  const std::vector<AlikeObject> alike = rig.alike();
  for (const RigObject& object : rig.objects) {
    if (has_markers(object.description)) continue;
    SL_RETURN_IF_ERROR(search->add_target(installation, object, cameras));
    search->targets_.back().alike = alike[object.named.id.index()];
  }
  if (search->targets_.empty()) return std::unique_ptr<ObjectSearch>();
  return search;
}

Status ObjectSearch::add_target(const Installation& installation, const RigObject& object,
                                const std::vector<DetectorCamera>& cameras) {
  DetectorOptions options = installation.detect.detector;
  options.volume = installation.scene.volume;
  DetectionPolicy policy(object.shape_symmetry, options.accept, object.printed);
  Target target{object.named.id, std::move(policy), object.views};
  target.printed = object.printed;
  SL_ASSIGN(target.colors, make_color_verifier(object, cameras));
  if (object.features) {
    SL_ASSIGN(target.features,
              FeatureDetector::create(object.features, cameras, {}, run_in_parallel));
  }
  SL_ASSIGN(target.detector, ObjectDetector::create(object.named.id, object.views, cameras,
                                                    DetectionPolicy::detector_options(
                                                        options, target.colors != nullptr),
                                                    run_in_parallel));
  if (target.colors) target.detector->prepare(*target.colors);
  const auto& start = installation.objects.at(object.named.id.index()).start;
  if (start) target.told = Told{*start, Time::max(), 0};
  targets_.push_back(std::move(target));
  return {};
}

bool ObjectSearch::due(const Target& target, Time now, std::span<const PoseTrackPtr> tracks) const {
  // What was found a moment ago is checked first; another search would take several times as long.
  if (std::ranges::any_of(targets_, [&](const Target& t) {
        return !t.printed && t.proof.unchecked() && now - t.handed_at < kTakenUp;
      })) {
    return false;
  }
  const bool paused = target.searched && now - target.last < target.pause;
  return (!paused || target.detector->waits()) && missing(target, now, tracks);
}

bool ObjectSearch::missing(const Target& target, Time now, std::span<const PoseTrackPtr> tracks) {
  const size_t index = target.object.index();
  const PoseTrackPtr track = index < tracks.size() ? tracks[index] : nullptr;
  if (!track || track->empty() || target.proof.disbelieved()) return true;
  const PoseEstimate& newest = track->newest();
  if (!has_pose(newest.state)) return true;
  return newest.state == TrackState::kCoasting && now - newest.last_measured > kBlindAfter;
}

bool ObjectSearch::due(Time now, std::span<const PoseTrackPtr> tracks) const {
  {
    std::lock_guard lock(mutex_);
    if (!messages_.empty()) return true;
  }
  return std::any_of(targets_.begin(), targets_.end(), [&](const Target& target) {
    return due(target, now, tracks) || check_due(target, now, tracks);
  });
}

void ObjectSearch::find_known(Time time, std::span<const PoseTrackPtr> tracks, bool coasting) {
  known_.clear();
  for (const Target& target : targets_) {
    const size_t index = target.object.index();
    if (index >= tracks.size() || !tracks[index]) continue;
    const PoseAt at = tracks[index]->at(time);
    if (at.source == PoseSource::kNone || !has_pose(at.estimate.state)) continue;
    const bool doubtful = at.estimate.state == TrackState::kCoasting || target.proof.disbelieved();
    if (doubtful && !coasting) continue;
    known_.push_back({target.views.get(), at.estimate.world_from_object});
  }
}

bool ObjectSearch::complete(Time now) const {
  const Duration waited = now - first_frame_;
  const bool enough = delivered_.size() >= std::min<size_t>(2, cameras_.size());
  return delivered_.size() >= cameras_.size() || waited >= (enough ? kFirstFrames : kAloneAfter);
}

bool ObjectSearch::learns(CameraId camera, Time capture) const {
  const size_t index = camera.index();
  return index < backgrounds_.size() && backgrounds_[index] && backgrounds_[index]->wants(capture);
}

std::vector<ObjectId> ObjectSearch::note_unseen(std::span<const PoseTrackPtr> tracks) {
  std::vector<ObjectId> out;
  for (Target& target : targets_) {
    const size_t index = target.object.index();
    if (index >= tracks.size() || !tracks[index] || tracks[index]->empty()) continue;
    const PoseEstimate& newest = tracks[index]->newest();
    if (newest.state != TrackState::kCoasting) continue;
    // Nobody has looked for it yet where it was found a moment ago.
    const bool taken_up = newest.last_measured > target.handed_at;
    if (!taken_up && newest.time - target.handed_at < kTakenUp) continue;
    if (target.proof.proven() && !target.printed) out.push_back(target.object);
    target.proof.begin_again();
  }
  return out;
}

void ObjectSearch::learn(CameraId camera, const Frame& frame,
                         std::span<const PoseTrackPtr> tracks) {
  const Time capture = frame.info().capture;
  if (!learns(camera, capture)) return;
  find_known(capture, tracks, true);
  backgrounds_[camera.index()]->learn(frame, known_);
}

void ObjectSearch::add_frame(CameraId camera, const Frame& frame,
                             std::span<const PoseTrackPtr> tracks) {
  if (trusted(frame)) learn(camera, frame, tracks);
  show(camera, frame, tracks);
}

void ObjectSearch::show(CameraId camera, const Frame& frame, std::span<const PoseTrackPtr> tracks) {
  const Time capture = frame.info().capture;
  if (delivered_.empty()) first_frame_ = capture;
  if (std::find(delivered_.begin(), delivered_.end(), camera) == delivered_.end()) {
    delivered_.push_back(camera);
  }
  if (!trusted(frame)) return;
  const BackgroundModel* background =
      camera.index() < backgrounds_.size() ? backgrounds_[camera.index()].get() : nullptr;
  const bool missing_any = std::any_of(targets_.begin(), targets_.end(), [&](const Target& target) {
    return missing(target, capture, tracks);
  });
  const bool searched = missing_any || due(capture, tracks);
  if (found_frames_ && searched) found_frames_->keep(camera, frame);
  if (missing_any && background != nullptr) find_known(capture, tracks, false);
  const bool is_known =
      missing_any && background != nullptr && background->foreground(frame, known_, foreground_);
  for (Target& target : targets_) {
    target.detector->add_frame(camera, frame, is_known ? &foreground_ : nullptr);
    if (target.colors) target.colors->add_frame(camera, frame);
    if (target.features) target.features->add_frame(camera, frame);
  }
}

bool ObjectSearch::hint(ObjectId object, const SearchHint& hint, Time until) {
  return tell({object, Told{hint, until, 0}});
}

bool ObjectSearch::forget(ObjectId object) { return tell({object, std::nullopt}); }

bool ObjectSearch::tell(Message message) {
  const bool known = std::any_of(targets_.begin(), targets_.end(), [&](const Target& target) {
    return target.object == message.object;
  });
  if (!known) return false;
  std::lock_guard lock(mutex_);
  messages_.push_back(std::move(message));
  return true;
}

void ObjectSearch::take_messages() {
  std::vector<Message> messages;
  {
    std::lock_guard lock(mutex_);
    messages.swap(messages_);
  }
  for (Message& message : messages) {
    for (Target& target : targets_) {
      if (target.object != message.object) continue;
      target.told = message.told;
      target.pause = Duration(0);
      if (message.told) continue;
      target.found = {};
      target.handed.reset();
      target.detector->forget();
    }
  }
}

Detection ObjectSearch::look_where_told(Target& target, Time now) {
  if (target.told && (now > target.told->until || target.told->tries++ >= kHintTries)) {
    target.told.reset();
  }
  if (!target.told) return {};
  Detection found =
      target.policy.by_outline(target.detector->detect_at(target.told->hint), target.colors.get());
  return found;
}

Detection ObjectSearch::by_features(Target& target, PoseProposals proposals) {
  const ColorVerifier* colors = target.colors.get();
  return target.policy.by_features(
      target.detector->judge(target.policy.confirm(std::move(proposals), colors)), colors);
}

Detection ObjectSearch::look_everywhere(Target& target) {
  if (target.features) {  // texture says more than an outline, and sooner
    feature_work_.textures += cameras_.size();
    Detection found = by_features(target, target.features->propose());
    target.by_features = !found.poses.empty();
    if (target.by_features) return found;
  }
  return target.policy.by_outline(target.detector->detect(target.colors.get()),
                                  target.colors.get());
}

std::vector<Observation> ObjectSearch::search(Time now, std::span<const PoseTrackPtr> tracks) {
  take_messages();
  // What waits to be found again comes first: soon it is elsewhere.
  const auto order = [](const Target& t) {
    return std::pair(!t.detector->waits(), t.searched ? t.last : Time::min());
  };
  Target* next = nullptr;
  for (Target& target : targets_) {
    target.found = {};
    if (!due(target, now, tracks)) continue;
    if (next == nullptr || order(target) < order(*next)) next = &target;
  }
  std::vector<Observation> out;
  Target* checked = nullptr;
  for (Target& target : targets_) {
    if (!check_due(target, now, tracks)) continue;
    if (checked == nullptr || (doubted(target) && !doubted(*checked))) checked = &target;
  }
  // A check takes a tenth of a search, or as long where it searches about the place, and until it
  // is done nothing is claimed.
  if (checked != nullptr && (next == nullptr || doubted(*checked))) {
    set_others(*checked, now, tracks);
    check(*checked, now, tracks, out);
  } else if (next != nullptr) {
    set_others(*next, now, tracks);
    search(*next, now, tracks, out);
  }
  return out;
}

void ObjectSearch::hand_out(Target& target, std::vector<Observation>& out) const {
  if (!target.found.poses.empty()) {
    target.handed = target.found.poses.front();
    target.handed_at = target.found.time;
  }
  if (found_frames_) found_frames_->offer(target.found, *target.views, target.refutes);
  for (const Observation& observation : target.found.observations) {
    out.push_back(observation);
    out.back().refutes = target.refutes;
  }
}

bool ObjectSearch::differs(const Target& target, const Rigid3& pose, const Detection& found) {
  const Rigid3& other = found.poses.front().world_from_object;
  const Eigen::Vector3d& center = target.views->center();
  return (other * center - pose * center).norm() > target.views->radius() ||
         target.views->angle_up_to_symmetry(pose, other) >= PoseProof::kSameOrientation;
}

bool ObjectSearch::found_where_tracked(Target& target, std::span<const PoseTrackPtr> tracks) {
  const size_t index = target.object.index();
  if (target.found.poses.empty() || index >= tracks.size() || !tracks[index]) return false;
  const PoseTrack& track = *tracks[index];
  if (track.empty() || !has_pose(track.newest().state)) return false;
  const PoseAt at = track.at(target.found.time);
  const PoseEstimate& tracked = at.source == PoseSource::kNone ? track.newest() : at.estimate;
  target.refutes = differs(target, tracked.world_from_object, target.found);
  return !target.refutes;
}

void ObjectSearch::search(Target& target, Time now, std::span<const PoseTrackPtr> tracks,
                          std::vector<Observation>& out) {
  if (!target.searched || now - target.last > target.pause + kForgotten) target.missing_since = now;
  target.last = now;
  target.searched = true;
  target.by_features = target.refutes = false;
  target.checked = now;
  target.proof.forget_suspicion();
  const SearchWork before = work();
  target.found = look_where_told(target, now);
  if (target.found.poses.empty()) {
    const ColorVerifier* colors = target.colors.get();
    target.found = target.detector->waits() && !target.told
                       ? target.policy.by_outline(target.detector->look_again(colors), colors)
                       : look_everywhere(target);
  }
  if (!target.found.poses.empty()) target.told.reset();
  target.print.begin(target.by_features);
  const bool disbelieved = target.proof.disbelieved();
  if (disbelieved && found_where_tracked(target, tracks)) {
    target.proof.note_found_again();
    target.found = {};
  } else if (!disbelieved || !target.found.poses.empty()) {
    target.proof.begin(target.found);
    checks_.refuted += target.refutes ? 1 : 0;
  }
  SearchWork done = work();
  done -= before;
  target.pause = pause_after(target, now, done);
  hand_out(target, out);
}

// What is not found for long is looked for at a bounded cost: by the model of it, so that a replay
// does the same on any machine.
Duration ObjectSearch::pause_after(Target& target, Time now, const SearchWork& work) const {
  if (!target.found.poses.empty()) target.missing_since = now;
  if (now - target.missing_since < kEager) return interval_;
  return std::max(interval_, from_seconds(to_seconds(search_cost(work)) / max_load_));
}

std::vector<Observation> ObjectSearch::follow(std::span<const FramePtr> frames,
                                              std::span<const PoseTrackPtr> tracks) {
  for (const FramePtr& frame : frames) show(frame->info().camera, *frame, tracks);
  std::vector<Observation> out;
  for (Target& target : targets_) {
    if (target.found.poses.empty()) continue;
    // The outline costs a fifth of the features; those are for what is covered.
    Detection now =
        target.policy.by_outline(target.detector->follow(target.found), target.colors.get());
    if (now.poses.empty() && target.by_features) {
      feature_work_.near_poses += cameras_.size();
      now = by_features(target, target.features->propose_near(target.found));
    }
    if (now.poses.empty()) continue;  // covered or blurred for a moment: the next frames may do
    target.found = std::move(now);
    hand_out(target, out);
  }
  return out;
}

SearchWork ObjectSearch::work() const {
  SearchWork sum = feature_work_;
  for (const Target& target : targets_) sum += target.detector->work();
  return sum;
}

}  // namespace sightline
