// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/cell/observation_gate.hpp"

#include <algorithm>

namespace sightline {
namespace {

constexpr size_t kMostBoots = 1024;  // kept of one host; older ones are beyond any age limit

}  // namespace

std::string_view to_string(CellVerdict verdict) {
  static constexpr std::array<std::string_view, kCellVerdicts> kNames = {
      "taken",   "late",        "future",    "duplicate", "old_boot",
      "foreign", "calibration", "malformed", "clock",     "superseded"};
  return kNames.at(static_cast<size_t>(verdict));
}

ObservationGate::ObservationGate(std::vector<Camera> cameras, std::vector<std::string> objects,
                                 Duration age_limit)
    : cameras_(std::move(cameras)), objects_(std::move(objects)), age_limit_(age_limit) {}

ObservationGate::Pass ObservationGate::check(const CellObservation& observation, int64_t now_utc_ns,
                                             bool fit, Duration slack, std::string_view cell) {
  const auto camera = std::ranges::find_if(cameras_, [&](const Camera& known) {
    return known.camera.name == observation.camera && known.camera.host == observation.host &&
           known.camera.cell == cell;
  });
  const auto object = std::ranges::find(objects_, observation.object);
  if (camera == cameras_.end() || object == objects_.end()) return {};
  const ObjectId id(static_cast<uint32_t>(object - objects_.begin()));
  const auto pass = [&](CellVerdict verdict) { return Pass{verdict, camera->id, id}; };
  if (camera->camera.calibration != observation.calibration) {
    return pass(CellVerdict::kOtherCalibration);
  }
  if (!fit) return pass(CellVerdict::kClock);
  // Age before boots: what is replayed from long ago must not pass for a start of the host.
  const Duration age(now_utc_ns - observation.capture_utc_ns);
  if (age > age_limit_) return pass(CellVerdict::kLate);
  if (-age > slack + kCaptureSlack) return pass(CellVerdict::kFuture);
  Host& host = hosts_[{camera->camera.cell, observation.host}];
  if (host.boot != observation.boot) {
    if (host.earlier.contains(observation.boot)) return pass(CellVerdict::kOldBoot);
    if (host.earlier.size() >= kMostBoots) host.earlier.clear();
    if (host.boot != 0) host.earlier.insert(host.boot);
    host.boot = observation.boot;
    host.sequence.clear();
  }
  uint64_t& newest = host.sequence[{camera->id.index(), id.index()}];
  if (observation.sequence <= newest) return pass(CellVerdict::kDuplicate);
  newest = observation.sequence;
  return pass(CellVerdict::kTaken);
}

}  // namespace sightline
