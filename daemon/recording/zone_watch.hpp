// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "sightline/base/counters.hpp"
#include "sightline/base/snapshot.hpp"
#include "sightline/config/zone_config.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline {

/// Notices when the origin of an object comes into a zone, and when it has gone. In is who was
/// measured in it (tracking or degraded); gone, who has not been for kGone.
class ZoneWatch {
 public:
  explicit ZoneWatch(Registry& registry) : registry_(registry) {}

  static constexpr Duration kGone = std::chrono::seconds(1);

  /// From now on; everybody is outside at first. One thread.
  void configure(std::vector<ZoneConfig> zones);
  /// Tells in log and metrics what changed; returns what is to be recorded because of it, and in
  /// `why` what to call that. On the estimator's thread; never waits.
  std::set<RecordingKind> take(const PoseEstimate& estimate, const std::string& object,
                               std::string& why);
  /// By ObjectId, the zones that each object is in. Null: no zones. Any thread.
  using Inside = std::vector<std::vector<std::string>>;
  std::shared_ptr<const Inside> inside() const { return inside_.read(); }

 private:
  struct Place {
    bool inside = false;
    Time last{};  ///< when it was in the zone
  };
  using Zones = std::vector<ZoneConfig>;
  void tell(const ZoneConfig& zone, const std::string& object, bool entered);
  void publish(size_t object);

  Registry& registry_;
  Snapshot<const Zones> zones_;
  Snapshot<const Inside> inside_;
  // The estimator's thread's:
  std::shared_ptr<const Zones> known_;
  struct Object {
    std::string name;           ///< a reload may give its id to another one
    std::vector<Place> places;  ///< by zone
  };
  std::vector<Object> objects_;  // by ObjectId
};

}  // namespace sightline
