// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/plan/search_distances.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <optional>

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {
namespace {

// Where the optical axes of two or more cameras meet best.
std::optional<Eigen::Vector3d> focus_of(std::span<const DetectorCamera> cameras) {
  if (cameras.size() < 2) return std::nullopt;
  Eigen::Matrix3d system = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const DetectorCamera& camera : cameras) {
    const Rigid3& pose = camera.calibration.world_from_camera;
    const Eigen::Vector3d axis = pose.rotation_matrix().col(2);
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    system += across;
    right += across * pose.translation;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> widths(system, Eigen::EigenvaluesOnly);
  if (widths.eigenvalues()[0] < 0.05) return std::nullopt;  // (nearly) parallel
  return Eigen::Vector3d(system.ldlt().solve(right));
}

// Of points all through the volume; empty if the camera is in it, or a part is behind the camera.
Eigen::AlignedBox2d image_of(const Box3& volume, const CalibratedCamera& camera) {
  constexpr int kSteps = 4;  // lines bend in a lens
  Eigen::AlignedBox2d out;
  const Rigid3 camera_from_world = camera.world_from_camera.inverse();
  for (int i = 0; i < (kSteps + 1) * (kSteps + 1) * (kSteps + 1); ++i) {
    const auto share = [](int step) { return static_cast<double>(step) / kSteps; };
    const Eigen::Vector3d point =
        volume.at(share(i % (kSteps + 1)), share(i / (kSteps + 1) % (kSteps + 1)),
                  share(i / (kSteps + 1) / (kSteps + 1)));
    const auto pixel = camera.model.project(camera_from_world * point);
    if (!pixel) return {};
    out.extend(*pixel);
  }
  const Eigen::Vector2d margin = 0.05 * out.sizes() + Eigen::Vector2d::Constant(2 * kMapShrink);
  return {out.min() - margin, out.max() + margin};
}

CameraDistances camera_distances(const CalibratedCamera& camera,
                                 const std::optional<Eigen::Vector3d>& focus, double diameter,
                                 const DetectorOptions& options) {
  const auto& lens = camera.model.parameters();
  double nearest = lens.fx * diameter / (options.max_height_share * lens.height);
  double farthest = lens.fx * diameter / options.min_diameter_px;
  double farthest_silhouette = lens.fx * diameter / options.min_silhouette_px;
  const Eigen::Vector3d& eye = camera.world_from_camera.translation;
  if (options.volume) {
    nearest = std::max(nearest, options.volume->distance(eye));
    farthest = std::min(farthest, options.volume->farthest(eye));
    farthest_silhouette = std::min(farthest_silhouette, options.volume->farthest(eye));
  } else if (focus) {
    const double usual = (*focus - eye).norm();
    nearest = std::max(nearest, 0.5 * usual);
    farthest = std::min(farthest, 1.7 * usual);
    farthest_silhouette = std::min(farthest_silhouette, 1.7 * usual);
  }
  if (options.nearest > 0) nearest = options.nearest;
  if (options.farthest > 0) farthest = farthest_silhouette = options.farthest;
  farthest = std::max(farthest, nearest);

  CameraDistances out;
  out.nearest = nearest;
  out.farthest = std::max(nearest, farthest_silhouette);
  if (options.volume && !camera.axes) out.image = image_of(*options.volume, camera);
  const double ratio = std::log(farthest / nearest) / std::log(kDistanceStep);
  const int steps = std::clamp(static_cast<int>(std::ceil(ratio)), 1, kMaxDistances);
  for (int i = 0; i < steps; ++i) {
    const double distance = nearest * std::pow(farthest / nearest, (i + 0.5) / steps);
    out.scales.push_back(static_cast<float>(lens.fx / (kMapShrink * distance)));
  }
  return out;
}

}  // namespace

SearchDistances search_distances(std::span<const DetectorCamera> cameras, double object_radius,
                                 const DetectorOptions& options) {
  const auto focus = focus_of(cameras);
  SearchDistances out;
  for (const DetectorCamera& camera : cameras) {
    out.cameras.push_back(camera_distances(camera.calibration, focus, 2 * object_radius, options));
    const double reach =
        1.1 * object_radius * static_cast<double>(out.cameras.back().scales.front());
    out.map_margin = std::max(out.map_margin, static_cast<int>(std::ceil(reach)) + 2);
  }
  return out;
}

}  // namespace sightline::observe
