// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sightline/model/pose_track.hpp"
#include "sightline/pipeline/camera_geometry.hpp"
#include "sightline/render/mesh/render_mesh.hpp"

namespace sightline {

/// A camera as it stands now.
struct SightCamera {
  CameraId camera;
  std::shared_ptr<const CameraGeometry> geometry;
  /// Of a camera that turns: where it looks. It is taken to stay there, and to look through the
  /// static scene, whose depth is known of cameras at rest.
  std::optional<Rigid3> world_from_camera{};
};

/// Whether one camera can see an object, and when that changes.
struct Sight {
  CameraId camera;
  double share = 0;                    ///< of the object that it can see now, 0 .. 1
  bool sees = false;                   ///< that is enough
  std::optional<double> changes_in{};  ///< [s]: then it does not any more, or does
};

/// Of one camera: the share of an object at `world_from_object` that lies in its image and before
/// the static scene, by points of the object's box.
double visible_share(const SightCamera& camera, const RenderMesh& object,
                     const Rigid3& world_from_object);

/// Which cameras can see an object at `now`, and which will or will not within kSightHorizon if it
/// goes on as it moves: by its newest estimate, the views and the static scene; other objects hide
/// nothing. Cameras of neither kind are left out; an object without a pose gives none.
std::vector<Sight> forecast_sight(const PoseTrack& track, Time now, const RenderMesh& object,
                                  std::span<const SightCamera> cameras);

constexpr double kSightHorizon = 2.0;  ///< [s]

}  // namespace sightline
