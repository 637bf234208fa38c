// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "observe/detect/search_camera.hpp"
#include "sightline/observe/shape/known_object.hpp"

namespace sightline::observe {

/// Places that other objects are known to take: what shows there is theirs.
class TakenPlaces {
 public:
  void set(std::vector<KnownObject> known) { known_ = std::move(known); }

  /// Whether an object at this pose would stand where one of them does: as near, and with about its
  /// silhouette from where the cameras are. What lies in a larger one, or beside it, does not.
  bool take(const ViewpointModel& model, const Rigid3& world_from_object,
            std::span<const SearchCamera> cameras) const;

 private:
  std::vector<KnownObject> known_;
};

}  // namespace sightline::observe
