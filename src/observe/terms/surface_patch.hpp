// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/geometry/rigid3.hpp"

namespace sightline::observe {

/// What a feature covers of an image, camera frame.
struct ImagePatch {
  Eigen::Vector3d ray = Eigen::Vector3d::UnitZ();        ///< unit, to its middle
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  ///< unit, across the ray: its orientation
  double size = 0;                                       ///< [rad]
};

/// The same of a surface, as it was seen once.
struct SurfacePatch {
  Eigen::Vector3d seen_from = Eigen::Vector3d::UnitZ();  ///< unit, to the camera
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();     ///< unit, outwards
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  ///< unit, along the surface
  double size = 0;                                       ///< across the line of sight [m]
};

/// By how much a patch may look otherwise than it should.
struct PatchTolerance {
  double turn = 0.6;    ///< of its orientation [rad]
  double times = 1.5;   ///< larger or smaller
  double facing = 0.2;  ///< least cosine between normal and line of sight
};

/// Of a feature of this orientation [rad, x to y] and size [px]; empty beyond the lens.
std::optional<ImagePatch> image_patch(const CameraModel& camera, const Eigen::Vector2d& pixel,
                                      double angle, double size_px);

/// What it covers of a surface with this normal, that far away [m]; camera frame.
SurfacePatch surface_patch(const ImagePatch& seen, const Eigen::Vector3d& normal, double distance);

/// Whether a patch of an object looks like that where its middle is at `point`, camera frame.
bool looks_like(const SurfacePatch& patch, const Eigen::Matrix3d& camera_from_object,
                const Eigen::Vector3d& point, const ImagePatch& seen,
                const PatchTolerance& tolerance);

/// camera_from_object of one patch with its middle at `point`, object frame: where it looks as it
/// was seen, tilted as it was then, or to the other side, which looks the same (a feature's
/// orientation and size make a pose: Lowe, 2004).
std::array<Rigid3, 2> patch_poses(const SurfacePatch& patch, const Eigen::Vector3d& point,
                                  const ImagePatch& seen);

}  // namespace sightline::observe
