// SPDX-License-Identifier: Apache-2.0
#include "cell/cell_local.hpp"

#include <algorithm>

namespace sightline {
namespace {

constexpr size_t kMostEstimates = 1024;  // that wait

}  // namespace

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
  if (!fed_) return;
  const std::lock_guard lock(mutex_);
  if (estimates_.size() < kMostEstimates) estimates_.push_back({estimate, cause});
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

std::vector<CellLocal::Estimate> CellLocal::take() {
  std::vector<Estimate> estimates;
  {
    const std::lock_guard lock(mutex_);
    estimates.swap(estimates_);
  }
  std::erase_if(estimates, [this](const Estimate& e) { return !runs(e.estimate.object); });
  return estimates;
}

}  // namespace sightline
