// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "observe/track/print/texture_points.hpp"

namespace sightline::observe {

/// Corners of a mesh's own textures, as they look from where the object is: rendered anew whenever
/// it is seen from another side or distance. Unlike points that are learned from images their
/// places on the mesh are known, so that they hold a pose whatever happened before.
class PrintPoints {
 public:
  PrintPoints(const CameraModel& camera, const PrintRendererFactory& factory);

  /// The points to be found around this pose; valid until the next call.
  TexturePoints& around(const Rigid3& camera_from_object);
  /// Of them, in the last image: on sides that are seen well enough.
  size_t tried() const { return points_.tried(); }
  /// There were enough, and image after image did not show them.
  bool given_up() const;

 private:
  bool outdated(const Rigid3& camera_from_object) const;
  void render(const Rigid3& camera_from_object);

  std::unique_ptr<PrintRenderer> renderer_;
  TexturePoints points_;
  Rigid3 rendered_at_;
  bool rendered_ = false;
  int since_ = 0;    ///< calls since it was rendered
  size_t made_ = 0;  ///< points then
  std::vector<uint8_t> smooth_;
};

}  // namespace sightline::observe
