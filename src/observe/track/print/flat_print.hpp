// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <span>

#include "observe/track/print/texture_points.hpp"
#include "sightline/base/time.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/model/observation.hpp"

namespace sightline::observe {

/// Whether what one camera sees of an object's print could be a picture of one of its sides on a
/// wall or on a box: points in one plane look the same there, at whatever distance, and pictures do
/// not move. Plain value.
class FlatPrint {
 public:
  /// `points` (object frame) of the print were found where the object is at `world_from_object`;
  /// `diameter` [m] is that of the object. Starts anew after 0.25 s, or where the print is next
  /// found more than 0.6 of the object's size away: that is another one.
  PrintSeen judge(Time capture, const Rigid3& world_from_object,
                  std::span<const TexturePoints::Found> points, double diameter,
                  const Rigid3& camera_from_world);

 private:
  /// Places on the print. They are where the image shows them whichever way its plane is tilted.
  using Marks = std::array<Eigen::Vector3d, 3>;
  struct Seen {
    Marks marks;   ///< object frame
    Rigid3 first;  ///< world_from_object
    Rigid3 last = {};
    Time at{};
    bool solid = false;
  };

  std::optional<Seen> seen_;
};

/// Whether points of a print are on sides that are not in one plane: several of them, for one may
/// have been found by chance. `diameter`: of the object.
bool several_planes(std::span<const TexturePoints::Found> points, double diameter);

}  // namespace sightline::observe
