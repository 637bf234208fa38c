// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/triangulation.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <optional>

namespace sightline {
namespace {

/// Rays closer to parallel than this leave the distance undetermined (0.01 degrees).
constexpr double kMinParallax = 1.7e-4;

/// Normal equations of the reprojection error at a point.
struct Normal {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  double cost = 0;                   ///< weighted, unitless
  double squared_px = 0;             ///< plain
  const char* bad_camera = nullptr;  ///< in which the point does not project
};

Normal linearize(std::span<const PointSight> sights, const Eigen::Vector3d& point_in_world) {
  Normal normal;
  for (const PointSight& sight : sights) {
    const Rigid3 camera_from_world = sight.camera->world_from_camera.inverse();
    Eigen::Matrix<double, 2, 3> in_camera;
    const auto pixel = sight.camera->model.project(camera_from_world * point_in_world, &in_camera);
    if (!pixel) {
      normal.bad_camera = sight.camera->name.c_str();
      return normal;
    }
    const Eigen::Matrix<double, 2, 3> j = in_camera * camera_from_world.rotation_matrix();
    const Eigen::Vector2d error = *pixel - sight.pixel;
    const double weight = 1 / (sight.sigma_px * sight.sigma_px);
    normal.information += weight * j.transpose() * j;
    normal.gradient += weight * j.transpose() * error;
    normal.cost += weight * error.squaredNorm();
    normal.squared_px += error.squaredNorm();
  }
  return normal;
}

struct Ray {
  Eigen::Vector3d origin;
  Eigen::Vector3d direction;
};

/// Point with the least squared distance to all rays; refused where they are all parallel.
Result<Eigen::Vector3d> midpoint(std::span<const PointSight> sights) {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  std::optional<Eigen::Vector3d> first;
  double parallax = 0;
  for (const PointSight& sight : sights) {
    const auto ray_in_camera = sight.camera->model.unproject(sight.pixel);
    if (!ray_in_camera) {
      return make_error(ErrorCode::kInvalidInput, sight.camera->name,
                        "pixel ({}, {}) has no ray through this lens", sight.pixel.x(),
                        sight.pixel.y());
    }
    const Rigid3& pose = sight.camera->world_from_camera;
    const Eigen::Vector3d d = pose.rotation * *ray_in_camera;
    if (!first) first = d;
    parallax = std::max(parallax, first->cross(d).norm());
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - d * d.transpose();
    a += across;
    b += across * pose.translation;
  }
  if (parallax < kMinParallax) {
    return make_error(ErrorCode::kInvalidInput, sights.front().camera->name,
                      "the rays of all {} sights are parallel, the distance cannot be told",
                      sights.size());
  }
  return Eigen::Vector3d(a.ldlt().solve(b));
}

Status check_sights(std::span<const PointSight> sights) {
  if (sights.size() < 2) {
    return make_error(ErrorCode::kInvalidInput, "triangulate",
                      "a point needs two sights or more, there are {}", sights.size());
  }
  for (const PointSight& sight : sights) {
    SL_CHECK(sight.camera != nullptr, "sight without camera");
    if (!(sight.sigma_px > 0) || !std::isfinite(sight.sigma_px)) {
      return make_error(ErrorCode::kInvalidInput, sight.camera->name,
                        "sigma of a sight must be positive, it is {} px", sight.sigma_px);
    }
  }
  return {};
}

Error does_not_project(const char* camera) {
  return make_error(ErrorCode::kInvalidInput, camera,
                    "the rays meet behind this camera or beyond its lens; the sights do not belong "
                    "to one point");
}

}  // namespace

Result<TriangulatedPoint> triangulate(std::span<const PointSight> sights) {
  SL_RETURN_IF_ERROR(check_sights(sights));
  SL_ASSIGN(Eigen::Vector3d point, midpoint(sights));
  Normal normal = linearize(sights, point);
  if (normal.bad_camera != nullptr) return does_not_project(normal.bad_camera);

  double damping = 0;
  for (int i = 0; i < 50; ++i) {
    Eigen::Matrix3d a = normal.information;
    a.diagonal() *= 1 + damping;
    const Eigen::Vector3d step = -a.ldlt().solve(normal.gradient);
    if (!step.allFinite()) break;
    const Normal next = linearize(sights, point + step);
    if (next.bad_camera == nullptr && next.cost <= normal.cost) {
      point += step;
      normal = next;
      damping *= 0.1;
      if (step.squaredNorm() < 1e-24 * (1 + point.squaredNorm())) break;
    } else {
      if (step.squaredNorm() < 1e-24 * (1 + point.squaredNorm())) break;
      damping = std::max(1e-4, 10 * damping);
    }
  }

  // An information matrix without inverse means the point runs off along a ray.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(normal.information);
  if (!(eigen.eigenvalues()(0) > 1e-12 * eigen.eigenvalues()(2))) {
    return make_error(ErrorCode::kInvalidInput, sights.front().camera->name,
                      "the rays of all {} sights are parallel, the distance cannot be told",
                      sights.size());
  }
  TriangulatedPoint out;
  out.point_in_world = point;
  out.covariance = eigen.eigenvectors() * eigen.eigenvalues().cwiseInverse().asDiagonal() *
                   eigen.eigenvectors().transpose();
  out.rms_px = std::sqrt(normal.squared_px / static_cast<double>(sights.size()));
  return out;
}

}  // namespace sightline
