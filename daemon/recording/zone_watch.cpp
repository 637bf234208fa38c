// SPDX-License-Identifier: Apache-2.0
#include "recording/zone_watch.hpp"

#include "sightline/base/log.hpp"

namespace sightline {

void ZoneWatch::configure(std::vector<ZoneConfig> zones) {
  const auto before = zones_.read();
  if (before ? *before == zones : zones.empty()) return;
  inside_.publish(zones.empty() ? nullptr : std::make_shared<const Inside>());
  zones_.publish(std::make_shared<const Zones>(std::move(zones)));
  if (before) {
    for (const ZoneConfig& zone : *before) registry_.remove("zone", zone.name);
  }
}

std::set<RecordingKind> ZoneWatch::take(const PoseEstimate& estimate, const std::string& object,
                                        std::string& why) {
  std::set<RecordingKind> kinds;
  const auto zones = zones_.read();
  if (!zones || (zones->empty() && objects_.empty())) return kinds;
  if (zones != known_) {
    known_ = zones;
    objects_.clear();
    inside_.publish(zones->empty() ? nullptr : std::make_shared<const Inside>());
  }
  const size_t index = estimate.object.index();
  if (index >= objects_.size()) objects_.resize(index + 1);
  if (objects_[index].name != object) {
    objects_[index] = {object, std::vector<Place>(zones->size())};
    if (inside_.read()) publish(index);
  }
  const bool measured =
      estimate.state == TrackState::kTracking || estimate.state == TrackState::kDegraded;
  bool changed = false;
  for (size_t i = 0; i < zones->size(); ++i) {
    const ZoneConfig& zone = (*zones)[i];
    if (!zone.watches(object)) continue;
    Place& place = objects_[index].places[i];
    const bool in = measured && zone.box.contains(estimate.world_from_object.translation);
    if (in) place.last = estimate.time;
    const bool inside = in || (place.inside && estimate.time - place.last <= kGone);
    if (inside == place.inside) continue;
    place.inside = inside;
    changed = true;
    tell(zone, object, inside);
    if (!inside || zone.record.empty()) continue;
    kinds.insert(zone.record.begin(), zone.record.end());
    why = object + " entered " + zone.name;
  }
  if (changed) publish(index);
  return kinds;
}

void ZoneWatch::tell(const ZoneConfig& zone, const std::string& object, bool entered) {
  log::info({.object = object, .cause = "zone"}, "{}: {} {}", object, entered ? "entered" : "left",
            zone.name);
  registry_
      .gauge("sightline_object_in_zone", "1 while the object is in this zone ([[zone]])",
             {{"object", object}, {"zone", zone.name}})
      .set(entered ? 1 : 0);
}

void ZoneWatch::publish(size_t object) {
  const auto before = inside_.read();
  auto next = before ? std::make_shared<Inside>(*before) : std::make_shared<Inside>();
  if (object >= next->size()) next->resize(object + 1);
  auto& names = (*next)[object];
  names.clear();
  for (size_t i = 0; i < known_->size(); ++i) {
    if (objects_[object].places[i].inside) names.push_back((*known_)[i].name);
  }
  inside_.publish(std::move(next));
}

}  // namespace sightline
