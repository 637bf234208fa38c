// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/tracking_chain.hpp"

#include <algorithm>

#include "sightline/observe/terms/observation_header.hpp"
#include "sightline/pipeline/calibration_proposal.hpp"

namespace sightline {

Result<std::unique_ptr<TrackingChain>> TrackingChain::create(const Installation& installation,
                                                             const Rig& rig,
                                                             std::span<const CameraId> cameras,
                                                             std::unique_ptr<ObjectSearch> search,
                                                             const SearchTiming& timing) {
  std::unique_ptr<TrackingChain> chain(new TrackingChain());
  chain->objects_ = rig.names();
  chain->observers_.resize(installation.cameras.size());
  chain->rooms_.resize(installation.cameras.size());
  const auto found = std::make_shared<FoundViews>();
  const auto references = std::make_shared<SceneReferences>();
  for (const CameraId camera : cameras) {
    SL_ASSIGN(chain->observers_.at(camera.index()),
              CameraObserver::create(installation, rig, camera));
    chain->observers_[camera.index()]->take_from(found);
    chain->rooms_[camera.index()] = RoomWatch::create(installation, rig, camera, references);
  }
  SL_ASSIGN(chain->fusion_,
            ObjectFusion::create(installation.estimator, chain->objects_, rig.shape_symmetry(),
                                 nullptr, make_calibration_watch(installation, rig)));
  chain->fusion_->watch_swaps(rig.alike());
  chain->search_ = std::move(search);
  if (chain->search_) chain->search_->offer_to(found);
  if (chain->search_ && !timing.instant) {
    chain->timed_ = std::make_unique<TimedSearch>(*chain->search_, installation.cameras.size(),
                                                  timing.cost_factor);
  }
  return chain;
}

std::unique_ptr<ObjectSearch> TrackingChain::take_search() {
  timed_.reset();
  return std::move(search_);
}

void TrackingChain::begin(Time now) {
  set_.clear();
  room_verdict_ = false;
  if (search_) {
    for (const ObjectId object : search_->note_unseen(tracks())) fusion_->set_doubted(object, true);
  }
  if (!timed_) return;
  const bool searching = timed_->under_way();
  const std::vector<Observation> found = timed_->advance(now, tracks());
  if (searching && (!found.empty() || !timed_->under_way())) take_doubts();
  for (const Observation& observation : found) fusion_->process({&observation, 1});
}

void TrackingChain::observe(const CameraFrame& seen) {
  const size_t first = set_.size();
  if (CameraObserver* const camera = observer(seen.camera)) {
    camera->step(*seen.frame, tracks(), set_);
  }
  if (RoomWatch* const room = rooms_.at(seen.camera.index()).get()) {
    const auto look = room->step(*seen.frame, tracks());
    if (look && fusion_->watch()) room_verdict_ |= fusion_->watch()->add(*look);
  }
  for (size_t i = first; i < set_.size(); ++i) set_[i].camera = seen.camera;
  for (const NamedObject& object : objects_) {
    const bool made = std::any_of(
        set_.begin() + static_cast<ptrdiff_t>(first), set_.end(),
        [&](const Observation& observation) { return observation.object == object.id; });
    if (!made) set_.push_back(make_observation(seen.frame->info(), seen.camera, object.id));
  }
}

bool TrackingChain::search(std::span<const CameraFrame> frames) {
  if (!search_ || frames.empty()) return false;
  if (!timed_) return search_at_once(frames);
  std::vector<CameraFrame> observed;
  for (const CameraFrame& seen : frames) {
    if (observer(seen.camera)) observed.push_back(seen);
  }
  return timed_->take(observed, tracks());
}

bool TrackingChain::search_at_once(std::span<const CameraFrame> frames) {
  for (const CameraFrame& seen : frames) {
    if (observer(seen.camera)) search_->add_frame(seen.camera, *seen.frame, tracks());
  }
  const Time now = frames.front().frame->info().capture;
  if (!search_->complete(now) || !search_->due(now, tracks())) return false;
  found_ = false;
  const std::vector<Observation> results = search_->search(now, tracks());
  search_->check_found();
  take_doubts();
  for (const Observation& found : results) {
    found_ = true;
    if (found.capture != now) {
      fusion_->process({&found, 1});
      continue;
    }
    for (Observation& known : set_) {
      const bool same = known.object == found.object && known.camera == found.camera;
      if (same && (known.terms.empty() || found.refutes)) known = found;
    }
  }
  return true;
}

void TrackingChain::take_doubts() {
  for (const ObjectSearch::Doubt& doubt : search_->doubts()) {
    fusion_->set_doubted(doubt.object, doubt.doubted);
  }
}

std::span<const UpdateReport> TrackingChain::fuse() { return fusion_->process(set_); }

}  // namespace sightline
