// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/judge/taken_places.hpp"

#include <algorithm>

#include "observe/detect/detect_constants.hpp"
#include "observe/shape/placed_mask.hpp"

namespace sightline::observe {
namespace {

// Mean over the cameras in front of which both are; 0: there are none.
double overlap(const ViewpointModel& model, const Rigid3& world_from_object,
               const KnownObject& other, std::span<const SearchCamera> cameras) {
  double sum = 0;
  int count = 0;
  for (const SearchCamera& camera : cameras) {
    const CameraModel& lens = camera.camera->model;
    const auto one = place_mask(model, lens, camera.camera_from_world * world_from_object);
    const auto two =
        place_mask(*other.views, lens, camera.camera_from_world * other.world_from_object);
    if (!one || !two) continue;
    sum += silhouette_overlap(model, *one, *other.views, *two);
    ++count;
  }
  return count > 0 ? sum / count : 0;
}

}  // namespace

bool TakenPlaces::take(const ViewpointModel& model, const Rigid3& world_from_object,
                       std::span<const SearchCamera> cameras) const {
  return std::any_of(known_.begin(), known_.end(), [&](const KnownObject& other) {
    const Eigen::Vector3d apart =
        world_from_object * model.center() - other.world_from_object * other.views->center();
    return apart.norm() < std::max(model.radius(), other.views->radius()) &&
           overlap(model, world_from_object, other, cameras) > kTakenOverlap;
  });
}

}  // namespace sightline::observe
