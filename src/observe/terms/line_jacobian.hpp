// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/geometry/rigid3.hpp"

namespace sightline::observe {

/// Projects points of an object at one pose and says how far they lie across a line of the image.
class LineProjector {
 public:
  LineProjector(const CameraModel& model, const Rigid3& camera_from_object)
      : model_(model),
        rotation_(camera_from_object.rotation_matrix()),
        translation_(camera_from_object.translation) {}

  Eigen::Vector3d in_camera(const Eigen::Vector3d& point_in_object) const {
    return rotation_ * point_in_object + translation_;
  }
  const Eigen::Matrix3d& rotation() const { return rotation_; }

  /// distance = normal . (pixel of the point - center) and its derivative by the pose's tangent:
  /// x = R (X + omega x X + v) + t, the perturbation acts on the object's side. False if the point
  /// does not project.
  bool distance(const Eigen::Vector3d& point_in_object, const Eigen::Vector2d& center,
                const Eigen::Vector2d& normal, double& distance, Vector6& by_pose) const {
    Eigen::Matrix<double, 2, 3> pixel_by_point;
    const auto pixel = model_.project(in_camera(point_in_object), &pixel_by_point);
    if (!pixel) return false;
    distance = normal.dot(*pixel - center);
    by_pose = derivative(point_in_object, normal, pixel_by_point);
    return true;
  }

  /// d (normal . pixel) / d tangent, from the projection's Jacobian.
  Vector6 derivative(const Eigen::Vector3d& point_in_object, const Eigen::Vector2d& normal,
                     const Eigen::Matrix<double, 2, 3>& pixel_by_point) const {
    const Eigen::Vector3d by_point = rotation_.transpose() * (pixel_by_point.transpose() * normal);
    Vector6 out;
    out << point_in_object.cross(by_point), by_point;
    return out;
  }

 private:
  const CameraModel& model_;
  Eigen::Matrix3d rotation_;
  Eigen::Vector3d translation_;
};

}  // namespace sightline::observe
