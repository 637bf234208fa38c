// SPDX-License-Identifier: Apache-2.0
#include "observe/track/symmetry/silhouette_comparison.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::observe {
namespace {

constexpr double kFilled = 0.9;          // of the grid's side by the bounding sphere
constexpr double kNearest = 4;           // [radii] nearer than this the grid's perspective is wrong
constexpr double kMinDiameterPx = 24;    // smaller ones are left alone
constexpr double kMinSeparation = 0.25;  // of the colors
constexpr double kMostOfCell = 1.5;      // log ratio of likelihoods
// Cells err together: what stands beside the object has one color over many of them.
constexpr double kIndependentCells = 1.0 / 8;

CameraModel grid_camera(int side, double distance) {
  CameraModel::Parameters parameters;
  parameters.width = parameters.height = side;
  parameters.fx = parameters.fy = 0.5 * kFilled * side / std::tan(std::asin(1 / distance));
  parameters.cx = parameters.cy = 0.5 * (side - 1);
  return CameraModel::create(parameters, "grid of silhouettes").value();
}

}  // namespace

SilhouetteComparison::SilhouetteComparison(const TrackerCamera& camera, const TrackedObject& object)
    : camera_(camera),
      object_(object),
      renderer_(object.silhouette(grid_camera(kSide, kDistance))),
      covered_(size_t{kSide} * kSide),
      bins_(size_t{kSide} * kSide) {}

void SilhouetteComparison::draw(const Rigid3& camera_from_object, uint32_t bit) {
  const DepthTile tile = renderer_->render(camera_from_object);
  for (int y = 0; y < tile.height; ++y) {
    uint32_t* row = covered_.data() + (tile.y + y) * kSide + tile.x;
    for (int x = 0; x < tile.width; ++x) {
      if (tile.row(y)[x] > 0) row[x] |= bit;
    }
  }
}

// The grid stands upright on the line of sight to the middle of the object, at its distance.
void SilhouetteComparison::read(const ColorReader& image, const Rigid3& camera_from_object,
                                const Eigen::Quaterniond& camera_from_grid,
                                const Occluders& occluders) {
  const CameraModel::Parameters& grid = renderer_->camera().parameters();
  const Eigen::Vector3d center = camera_from_object * object_.views->center();
  const double cell = kDistance * object_.views->radius() / grid.fx;  // [m]
  const Eigen::Vector3d right = camera_from_grid * Eigen::Vector3d(cell, 0, 0);
  const Eigen::Vector3d down = camera_from_grid * Eigen::Vector3d(0, cell, 0);
  std::fill(bins_.begin(), bins_.end(), kUnknown);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const Eigen::Vector3d point = center + (x - grid.cx) * right + (y - grid.cy) * down;
      const auto pixel = camera_.camera->model.project(point);
      if (!pixel) continue;
      const int px = static_cast<int>(std::lround(pixel->x()));
      const int py = static_cast<int>(std::lround(pixel->y()));
      if (px < 0 || py < 0 || px >= image.width() || py >= image.height()) continue;
      if (occluders.hide(*pixel, point)) continue;
      bins_[static_cast<size_t>(y * kSide + x)] = image.bin(px, py);
    }
  }
}

bool SilhouetteComparison::learn(uint32_t all) {
  foreground_.clear();
  background_.clear();
  for (size_t i = 0; i < bins_.size(); ++i) {
    if (bins_[i] == kUnknown) continue;
    if (covered_[i] == all) foreground_.push_back(bins_[i]);
    if (covered_[i] == 0) background_.push_back(bins_[i]);
  }
  colors_.forget();
  return colors_.learn(foreground_, background_, 1.0f) && colors_.separation() >= kMinSeparation;
}

const std::vector<double>& SilhouetteComparison::compare(const ColorReader& image,
                                                         const Rigid3& pose,
                                                         const Occluders& occluders) {
  costs_.clear();
  const Rigid3 camera_from_object = camera_.camera_from_world * pose;
  const Eigen::Vector3d& middle = object_.views->center();
  const Eigen::Vector3d center = camera_from_object * middle;
  const double radius = object_.views->radius(), distance = center.norm();
  const double focal = camera_.camera->model.parameters().fx;
  if (!(center.z() > 0) || distance < kNearest * radius ||
      2 * radius * focal < kMinDiameterPx * distance) {
    return costs_;
  }
  const auto camera_from_grid =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), center);
  const auto& turns = object_.shape_symmetry.near_rotations;
  std::fill(covered_.begin(), covered_.end(), 0);
  const Eigen::Quaterniond rotation = camera_from_grid.conjugate() * camera_from_object.rotation;
  const Eigen::Vector3d in_front(0, 0, kDistance * radius);
  const Rigid3 grid_from_object(rotation, in_front - rotation * middle);
  draw(grid_from_object, 1);
  for (size_t k = 0; k < turns.size(); ++k) {
    draw(grid_from_object * turns[k], uint32_t{2} << k);
  }
  const uint32_t all = static_cast<uint32_t>((uint64_t{2} << turns.size()) - 1);
  read(image, camera_from_object, camera_from_grid, occluders);
  if (!learn(all)) return costs_;
  costs_.assign(turns.size() + 1, 0.0);
  const float* evidence = colors_.evidence();
  for (size_t i = 0; i < bins_.size(); ++i) {
    if (bins_[i] == kUnknown || covered_[i] == 0 || covered_[i] == all) continue;
    const double e = std::clamp(double{evidence[bins_[i]]}, -0.99, 0.99);
    const double ratio = std::clamp(2 * std::atanh(e), -kMostOfCell, kMostOfCell);
    for (size_t k = 0; k < costs_.size(); ++k) {
      if ((covered_[i] >> k & 1) != 0) costs_[k] -= kIndependentCells * ratio;
    }
  }
  return costs_;
}

}  // namespace sightline::observe
