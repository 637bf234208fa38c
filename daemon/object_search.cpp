// SPDX-License-Identifier: Apache-2.0
#include "object_search.hpp"

#include <algorithm>

#include "object_views.hpp"
#include "sightline/observe/lookalikes.hpp"
#include "surface_spots.hpp"

namespace sightline {
namespace {

// The colours of the mesh may be anything, so they do not refuse a pose; but where they agree with
// the pictures, less of outline and edges is enough.
constexpr double kColoursAgree = 0.35;  // correlation
constexpr double kWithColours = 0.75;   // of the evidence that is asked for
constexpr double kWithoutColours = 1.35;
constexpr double kCostOfMatch = 0.5;  // -log likelihood, at most, of one in the wrong place

// Markers find an object faster and never mistake it.
bool found_by_markers(const ObjectDescription& object) {
  return object.cues.fiducial && (object.board.has_value() || !object.fiducials.empty());
}

// Null where the mesh has no colours to tell its sides apart by.
Result<std::unique_ptr<SurfaceLook>> make_look(const RigObject& object,
                                               const std::vector<DetectorCamera>& cameras) {
  SL_ASSIGN(std::vector<SurfaceSpot> spots,
            surface_spots(object.description.mesh, object.description.meters_per_unit));
  if (spots.empty()) return std::unique_ptr<SurfaceLook>();
  return SurfaceLook::create(std::move(spots), cameras);
}

// Mean over the cameras that see it; 0 without colours.
double likeness(const SurfaceLook* look, const Detection& detection) {
  if (look == nullptr || detection.observations.empty()) return 0;
  double sum = 0;
  for (const Observation& observation : detection.observations) {
    sum += look->likeness(observation, observation.hypotheses.front().world_from_object);
  }
  return sum / static_cast<double>(detection.observations.size());
}

// What is left of a detection after the colours have been asked; nothing if it is too weak then.
Detection believed(Detection detection, const SurfaceLook* look, const Lookalikes& lookalikes,
                   double accept) {
  if (look != nullptr) {
    look->resolve(detection);
    look->compare(lookalikes, detection);
  }
  if (detection.poses.empty() || likeness(look, detection) >= kColoursAgree) return detection;
  const double needed = kWithoutColours * accept;
  return detection.poses.front().evidence >= needed ? detection : Detection();
}

// The print tells poses apart that look alike by shape: what supports this one is elsewhere in the
// others.
void tell_sides(const Lookalikes& lookalikes, Detection& detection) {
  if (detection.poses.size() != 1 || lookalikes.turns.empty()) return;
  for (Observation& observation : detection.observations) {
    const PoseTerm& term = *observation.terms.front();
    const Rigid3 pose = observation.hypotheses.front().world_from_object;
    const LinearizedTerm at = term.linearize(pose);
    const double most = kCostOfMatch * at.residuals / 2;
    observation.alike = {{pose, 0}};
    for (const Rigid3& turn : lookalikes.turns) {
      const double cost = term.linearize(pose * turn).cost - at.cost;
      observation.alike.push_back({pose * turn, std::clamp(cost, 0.0, most)});
    }
  }
}

void append(const Detection& detection, std::vector<Observation>& out) {
  out.insert(out.end(), detection.observations.begin(), detection.observations.end());
}

}  // namespace

Result<std::unique_ptr<ObjectSearch>> ObjectSearch::create(const Installation& installation,
                                                           const Rig& rig,
                                                           const std::filesystem::path& cache) {
  std::unique_ptr<ObjectSearch> search(new ObjectSearch());
  if (!installation.detect.enabled) return std::unique_ptr<ObjectSearch>();
  search->interval_ = installation.detect.interval;
  search->accept_ = installation.detect.detector.accept;
  std::vector<DetectorCamera> cameras;
  for (size_t i = 0; i < installation.cameras.size(); ++i) {
    const CameraConfig& camera = installation.cameras[i];
    if (!observes(camera.role)) continue;
    cameras.push_back({CameraId(static_cast<uint32_t>(i)), camera.calibration});
    if (!installation.detect.silhouettes) continue;
    search->backgrounds_.resize(installation.cameras.size());
    SL_ASSIGN(search->backgrounds_[i],
              BackgroundModel::create(camera.calibration, installation.detect.background));
  }
  if (cameras.empty()) return std::unique_ptr<ObjectSearch>();
  for (const RigObject& object : rig.objects) {
    if (found_by_markers(object.description)) continue;
    SL_ASSIGN(auto views, load_views(object, cache));
    Wanted wanted;
    wanted.object = object.named.id;
    wanted.lookalikes = lookalikes_of(*views, object.description);
    wanted.views = views;
    SL_ASSIGN(wanted.look, make_look(object, cameras));
    if (object.features) {
      SL_ASSIGN(wanted.features, FeatureDetector::create(object.features, cameras));
    }
    DetectorOptions options = installation.detect.detector;
    if (wanted.look) options.accept *= kWithColours;
    SL_ASSIGN(wanted.detector,
              ObjectDetector::create(object.named.id, std::move(views), cameras, options));
    search->wanted_.push_back(std::move(wanted));
  }
  if (search->wanted_.empty()) return std::unique_ptr<ObjectSearch>();
  return search;
}

bool ObjectSearch::due(const Wanted& wanted, Time now, std::span<const PoseTrackPtr> tracks) const {
  return !(wanted.searched && now - wanted.last < interval_) && missing(wanted, now, tracks);
}

bool ObjectSearch::missing(const Wanted& wanted, Time now, std::span<const PoseTrackPtr> tracks) {
  const size_t index = wanted.object.index();
  const PoseTrackPtr track = index < tracks.size() ? tracks[index] : nullptr;
  if (!track || track->empty()) return true;
  const PoseEstimate& newest = track->newest();
  if (!has_pose(newest.state)) return true;
  return newest.state == TrackState::kCoasting && now - newest.last_measured > kBlindAfter;
}

bool ObjectSearch::due(Time now, std::span<const PoseTrackPtr> tracks) const {
  return std::any_of(wanted_.begin(), wanted_.end(),
                     [&](const Wanted& wanted) { return due(wanted, now, tracks); });
}

void ObjectSearch::find_known(Time time, std::span<const PoseTrackPtr> tracks, bool coasting) {
  known_.clear();
  for (const Wanted& wanted : wanted_) {
    const size_t index = wanted.object.index();
    if (index >= tracks.size() || !tracks[index]) continue;
    const PoseAt at = tracks[index]->at(time);
    if (at.source == PoseSource::kNone || !has_pose(at.estimate.state)) continue;
    if (at.estimate.state == TrackState::kCoasting && !coasting) continue;
    known_.push_back({wanted.views.get(), at.estimate.world_from_object});
  }
}

bool ObjectSearch::learns(CameraId camera, Time capture) const {
  const size_t index = camera.index();
  return index < backgrounds_.size() && backgrounds_[index] && backgrounds_[index]->wants(capture);
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
  const Time capture = frame.info().capture;
  learn(camera, frame, tracks);
  const BackgroundModel* background =
      camera.index() < backgrounds_.size() ? backgrounds_[camera.index()].get() : nullptr;
  const bool wants = std::any_of(wanted_.begin(), wanted_.end(), [&](const Wanted& wanted) {
    return missing(wanted, capture, tracks);
  });
  if (wants && background != nullptr) find_known(capture, tracks, false);
  const bool is_known =
      wants && background != nullptr && background->foreground(frame, known_, foreground_);
  for (Wanted& wanted : wanted_) {
    wanted.detector->add_frame(camera, frame, is_known ? &foreground_ : nullptr);
    if (wanted.look) wanted.look->add_frame(camera, frame);
    if (wanted.features) wanted.features->add_frame(camera, frame);
  }
}

std::vector<Observation> ObjectSearch::search(Time now, std::span<const PoseTrackPtr> tracks) {
  std::vector<Observation> out;
  for (Wanted& wanted : wanted_) {
    wanted.found = {};
    if (!due(wanted, now, tracks)) continue;
    wanted.last = now;
    wanted.searched = true;
    if (wanted.features) wanted.found = found_by_print(wanted, wanted.features->propose());
    wanted.by_print = !wanted.found.poses.empty();
    if (!wanted.by_print) {
      wanted.found =
          believed(wanted.detector->detect(), wanted.look.get(), wanted.lookalikes, accept_);
    }
    append(wanted.found, out);
  }
  return out;
}

// A print says more than an outline, and sooner.
Detection ObjectSearch::found_by_print(Wanted& wanted, const Proposals& proposals) {
  Detection found = wanted.detector->judge(proposals);
  if (wanted.look) wanted.look->resolve(found);
  tell_sides(wanted.lookalikes, found);
  return found;
}

std::vector<Observation> ObjectSearch::follow() {
  std::vector<Observation> out;
  for (Wanted& wanted : wanted_) {
    if (wanted.found.poses.empty()) continue;
    if (wanted.by_print) {
      wanted.found = found_by_print(wanted, wanted.features->propose_near(wanted.found));
    } else {
      wanted.found = believed(wanted.detector->follow(wanted.found), wanted.look.get(),
                              wanted.lookalikes, accept_);
    }
    append(wanted.found, out);
  }
  return out;
}

}  // namespace sightline
