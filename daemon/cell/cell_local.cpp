// SPDX-License-Identifier: Apache-2.0
#include "cell/cell_local.hpp"

#include <algorithm>

namespace sightline {

CellLocal::CellLocal(const CellParts& parts, Registry& registry)
    : parts_(parts), runs_(parts.names.objects.size()) {
  for (const std::string& object : parts.names.objects) {
    shown_.push_back(&registry.gauge("sightline_cell_local",
                                     "1 while this host estimates the object by itself",
                                     {{"object", object}}));
  }
}

void CellLocal::push(const Observation& observation) {
  if (fed_) parts_.fusion->push(observation);
}

void CellLocal::push(const PoseEstimate& estimate, FusionWorker::Cause cause) {
  if (fed_) estimates_.push(estimate, cause);
}

void CellLocal::begin(ObjectId object, PoseTrackPtr last) {
  runs_[object.index()] = 1;
  note();
  parts_.fusion->adopt(std::move(last));
}

void CellLocal::end(ObjectId object) {
  runs_[object.index()] = 0;
  note();
}

void CellLocal::note() {
  fed_ = std::ranges::any_of(runs_, [](char runs) { return runs != 0; });
  for (size_t i = 0; i < runs_.size(); ++i) shown_[i]->set(runs_[i]);
}

PoseTrackPtr CellLocal::track(ObjectId object) const {
  std::vector<PoseTrackPtr> tracks;
  parts_.own_board->read(tracks);
  if (tracks[object.index()] != nullptr) return tracks[object.index()];
  return std::make_shared<const PoseTrack>(object, std::vector<PoseEstimate>(), parts_.noise);
}

std::vector<QueuedEstimate> CellLocal::take() {
  std::vector<QueuedEstimate> estimates = estimates_.take();
  std::erase_if(estimates, [this](const QueuedEstimate& e) { return !runs(e.estimate.object); });
  return estimates;
}

}  // namespace sightline
