// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/search_distances.hpp"

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

CameraDistances camera_distances(const CalibratedCamera& camera,
                                 const std::optional<Eigen::Vector3d>& focus, double diameter,
                                 const DetectorOptions& options) {
  const auto& lens = camera.model.parameters();
  double nearest = lens.fx * diameter / (options.max_height_share * lens.height);
  double farthest = lens.fx * diameter / options.min_diameter_px;
  double farthest_silhouette = lens.fx * diameter / options.min_silhouette_px;
  if (focus) {
    const double usual = (*focus - camera.world_from_camera.translation).norm();
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
