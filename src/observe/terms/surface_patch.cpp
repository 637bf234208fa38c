// SPDX-License-Identifier: Apache-2.0
#include "observe/terms/surface_patch.hpp"

#include <Eigen/Geometry>
#include <cmath>

namespace sightline::observe {
namespace {

constexpr double kBesidePx = 3;  // where the orientation is measured

Eigen::Vector3d across(const Eigen::Vector3d& vector, const Eigen::Vector3d& ray) {
  return vector - ray * ray.dot(vector);
}

// Axes of a view along `forward`, x as near to `right` as it can be.
Eigen::Matrix3d view_axes(const Eigen::Vector3d& right, const Eigen::Vector3d& forward) {
  Eigen::Matrix3d out;
  out.col(2) = forward;
  out.col(0) = across(right, forward).normalized();
  out.col(1) = out.col(2).cross(out.col(0));
  return out;
}

}  // namespace

std::optional<ImagePatch> image_patch(const CameraModel& camera, const Eigen::Vector2d& pixel,
                                      double angle, double size_px) {
  const auto ray = camera.unproject(pixel);
  const auto beside =
      camera.unproject(pixel + kBesidePx * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  if (!ray || !beside) return std::nullopt;
  ImagePatch out;
  out.ray = ray->normalized();
  const Eigen::Vector3d step = across(beside->normalized(), out.ray);
  const double length = step.norm();
  if (!(length > 0)) return std::nullopt;
  out.direction = step / length;
  out.size = size_px * length / kBesidePx;
  return out;
}

SurfacePatch surface_patch(const ImagePatch& seen, const Eigen::Vector3d& normal, double distance) {
  const double steep = normal.dot(seen.ray);
  const Eigen::Vector3d along =
      seen.direction - seen.ray * (normal.dot(seen.direction) / std::min(steep, -1e-6));
  return {-seen.ray, normal, along.normalized(), seen.size * distance};
}

bool looks_like(const SurfacePatch& patch, const Eigen::Matrix3d& camera_from_object,
                const Eigen::Vector3d& point, const ImagePatch& seen,
                const PatchTolerance& tolerance) {
  const double distance = point.norm();
  if (-point.dot(camera_from_object * patch.normal) < tolerance.facing * distance) return false;
  const double size = patch.size / distance;
  if (size > seen.size * tolerance.times || seen.size > size * tolerance.times) return false;
  const Eigen::Vector3d direction = across(camera_from_object * patch.direction, point / distance);
  return direction.dot(seen.direction) >= std::cos(tolerance.turn) * direction.norm();
}

std::array<Rigid3, 2> patch_poses(const SurfacePatch& patch, const Eigen::Vector3d& point,
                                  const ImagePatch& seen) {
  const Eigen::Matrix3d camera = view_axes(seen.direction, seen.ray);
  const Eigen::Vector3d place = seen.ray * (patch.size / seen.size);
  const Eigen::Vector3d mirrored =
      2 * patch.normal.dot(patch.seen_from) * patch.normal - patch.seen_from;
  const auto pose = [&](const Eigen::Vector3d& seen_from) {
    const Eigen::Matrix3d rotation = camera * view_axes(patch.direction, -seen_from).transpose();
    return Rigid3(Eigen::Quaterniond(rotation), place - rotation * point);
  };
  return {pose(patch.seen_from), pose(mirrored)};
}

}  // namespace sightline::observe
