// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "sightline/render/overlay/virtual_camera.hpp"

namespace sightline {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kElevation = 35 * kDegree;  // of the place that is chosen
constexpr double kAside = 30 * kDegree;      // from the cameras' own side
constexpr double kInside = 0.8;              // of the way to the border at most

Eigen::Vector3d axis_of(const CalibratedCamera& camera) {
  return camera.world_from_camera.rotation_matrix().col(2);
}

// Where the image of a point lies between its middle (0) and its border (1 and more); behind the
// eye: far outside.
double off_center(const Eigen::Vector3d& point, const Eigen::Vector3d& eye,
                  const Eigen::Vector3d& target, const Eigen::Vector3d& up, double half_width,
                  double half_height) {
  const Eigen::Vector3d forward = (target - eye).normalized();
  const Eigen::Vector3d right = forward.cross(up).normalized();
  const Eigen::Vector3d d = point - eye;
  const double depth = d.dot(forward);
  if (depth <= 0) return 1e9;
  return std::max(std::abs(d.dot(right)) / (depth * half_width),
                  std::abs(d.dot(forward.cross(right))) / (depth * half_height));
}

// On the cameras' side, so that one looks over their shoulders, and just far enough to see them
// all.
Eigen::Vector3d default_eye(const ViewPoint& point, const Eigen::Vector3d& target,
                            std::span<const CalibratedCamera> cameras) {
  const Eigen::Vector3d up = point.up.normalized();
  Eigen::Vector3d side = Eigen::Vector3d::Zero();
  double reach = 0.1;
  for (const CalibratedCamera& camera : cameras) {
    const Eigen::Vector3d from_target = camera.world_from_camera.translation - target;
    reach = std::max(reach, from_target.norm());
    side += from_target.normalized();
  }
  side -= side.dot(up) * up;
  if (side.norm() < 0.1) side = up.unitOrthogonal();  // cameras all around
  side = Eigen::AngleAxisd(kAside, up) * side.normalized();
  const Eigen::Vector3d direction = std::cos(kElevation) * side + std::sin(kElevation) * up;
  const double half_width = std::tan(0.5 * point.fov_deg * kDegree);
  const double half_height = half_width * point.height / point.width;
  double distance = 0.5 * reach;
  const auto all_inside = [&] {
    return std::all_of(cameras.begin(), cameras.end(), [&](const CalibratedCamera& camera) {
      return off_center(camera.world_from_camera.translation, target + distance * direction, target,
                        up, half_width, half_height) < kInside;
    });
  };
  for (int i = 0; i < 100 && !all_inside(); ++i) distance *= 1.05;
  return target + distance * direction;
}

Error fault(const std::string& where, const char* text) {
  return Error{ErrorCode::kInvalidInput, text, where};
}

}  // namespace

Eigen::Vector3d where_cameras_look(std::span<const CalibratedCamera> cameras) {
  if (cameras.empty()) return Eigen::Vector3d::Zero();
  // A weak pull towards one meter ahead of the cameras decides what their axes leave open.
  constexpr double kPull = 1e-3;
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const CalibratedCamera& camera : cameras) {
    const Eigen::Vector3d axis = axis_of(camera), eye = camera.world_from_camera.translation;
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    a += across + kPull * Eigen::Matrix3d::Identity();
    b += across * eye + kPull * (eye + axis);
  }
  return a.ldlt().solve(b);
}

Result<CalibratedCamera> make_view_camera(const ViewPoint& point,
                                          std::span<const CalibratedCamera> cameras,
                                          const std::string& name, const std::string& where) {
  if (point.width % 2 != 0 || point.height % 2 != 0 || std::min(point.width, point.height) < 16 ||
      std::max(point.width, point.height) > 8192) {
    return fault(where, "width and height of a view are even, 16 to 8192");
  }
  if (!(point.fov_deg >= 5 && point.fov_deg <= 150)) {
    return fault(where, "the field of view is 5 to 150 degrees");
  }
  if (!point.up.allFinite() || point.up.norm() < 1e-9) return fault(where, "up has no direction");
  const Eigen::Vector3d target = point.target.value_or(where_cameras_look(cameras));
  const Eigen::Vector3d eye = point.eye ? *point.eye : default_eye(point, target, cameras);
  const Eigen::Vector3d sight = target - eye;
  if (!sight.allFinite() || sight.norm() < 1e-6) {
    return fault(where, "the eye of the view is at its target");
  }
  Eigen::Matrix4d world_from_camera = Eigen::Matrix4d::Identity();
  const Eigen::Vector3d forward = sight.normalized();
  const Eigen::Vector3d right = forward.cross(point.up.normalized());
  if (right.norm() < 1e-3) {
    return fault(where, "the view looks along `up`: give another up, as [0, 1, 0]");
  }
  world_from_camera.block<3, 1>(0, 0) = right.normalized();
  world_from_camera.block<3, 1>(0, 1) = forward.cross(right.normalized());
  world_from_camera.block<3, 1>(0, 2) = forward;
  world_from_camera.block<3, 1>(0, 3) = eye;
  CameraModel::Parameters lens;
  lens.width = point.width;
  lens.height = point.height;
  lens.fx = lens.fy = 0.5 * point.width / std::tan(0.5 * point.fov_deg * kDegree);
  lens.cx = 0.5 * (point.width - 1);
  lens.cy = 0.5 * (point.height - 1);
  SL_ASSIGN(const CameraModel model, CameraModel::create(lens, where));
  SL_ASSIGN(const Rigid3 pose, Rigid3::from_matrix(world_from_camera, where));
  return CalibratedCamera{name, model, pose};
}

}  // namespace sightline
