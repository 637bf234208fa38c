// SPDX-License-Identifier: Apache-2.0
#include "observe/track/silhouettes/silhouette_grid.hpp"

#include <algorithm>
#include <cmath>

#include "sightline/geometry/rotation_between.hpp"

namespace sightline::observe {
namespace {

constexpr double kDistance = 8;        // [radii] of the camera that draws the object
constexpr double kNearest = 4;         // [radii] nearer than this the grid's perspective is wrong
constexpr double kMinDiameterPx = 24;  // smaller ones are left alone

CameraModel grid_camera(int side, double filled) {
  CameraModel::Parameters parameters;
  parameters.width = parameters.height = side;
  parameters.fx = parameters.fy = 0.5 * filled * side / std::tan(std::asin(1 / kDistance));
  parameters.cx = parameters.cy = 0.5 * (side - 1);
  return CameraModel::create(parameters, "grid of silhouettes").value();
}

// True if the line of sight to the point passes through another object's sphere.
bool on_other(const Eigen::Vector3d& point, const Occluders& occluders) {
  const Eigen::Vector3d direction = point.normalized();
  return std::ranges::any_of(occluders.spheres, [&](const OccludingSphere& sphere) {
    const double along = direction.dot(sphere.center_in_camera);
    return along > 0 &&
           sphere.center_in_camera.squaredNorm() - along * along < sphere.radius * sphere.radius;
  });
}

}  // namespace

SilhouetteGrid::SilhouetteGrid(const TrackerCamera& camera, const TrackedObject& object,
                               double filled)
    : camera_(camera),
      object_(object),
      renderer_(object.silhouette(grid_camera(kSide, filled))),
      covered_(kCells),
      bins_(kCells) {}

bool SilhouetteGrid::aim(const Rigid3& world_from_object) {
  camera_from_object_ = camera_.camera_from_world * world_from_object;
  const Eigen::Vector3d& middle = object_.views->center();
  const Eigen::Vector3d center = camera_from_object_ * middle;
  const double radius = object_.views->radius(), distance = center.norm();
  const double focal = camera_.camera->model.parameters().fx;
  if (!(center.z() > 0) || distance < kNearest * radius ||
      2 * radius * focal < kMinDiameterPx * distance) {
    return false;
  }
  camera_from_grid_ = rotation_between(Eigen::Vector3d::UnitZ(), center);
  const Eigen::Quaterniond rotation = camera_from_grid_.conjugate() * camera_from_object_.rotation;
  const Eigen::Vector3d in_front(0, 0, kDistance * radius);
  grid_from_object_ = Rigid3(rotation, in_front - rotation * middle);
  std::fill(covered_.begin(), covered_.end(), 0);
  return true;
}

void SilhouetteGrid::draw(const Rigid3& turn, uint32_t bit) {
  const DepthTile tile = renderer_->render(grid_from_object_ * turn);
  for (int y = 0; y < tile.height; ++y) {
    uint32_t* row = covered_.data() + (tile.y + y) * kSide + tile.x;
    for (int x = 0; x < tile.width; ++x) {
      if (tile.row(y)[x] > 0) row[x] |= bit;
    }
  }
}

// The grid lies at the distance of the object's middle.
void SilhouetteGrid::read(const ColorReader& image, const Occluders& occluders,
                          bool without_others) {
  const CameraModel::Parameters& grid = renderer_->camera().parameters();
  const Eigen::Vector3d center = camera_from_object_ * object_.views->center();
  const double cell = kDistance * object_.views->radius() / grid.fx;  // [m]
  const Eigen::Vector3d right = camera_from_grid_ * Eigen::Vector3d(cell, 0, 0);
  const Eigen::Vector3d down = camera_from_grid_ * Eigen::Vector3d(0, cell, 0);
  std::fill(bins_.begin(), bins_.end(), kUnknown);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const Eigen::Vector3d point = center + (x - grid.cx) * right + (y - grid.cy) * down;
      const auto pixel = camera_.camera->model.project(point);
      if (!pixel) continue;
      const int px = static_cast<int>(std::lround(pixel->x()));
      const int py = static_cast<int>(std::lround(pixel->y()));
      if (px < 0 || py < 0 || px >= image.width() || py >= image.height()) continue;
      if (occluders.hide(*pixel, point) || (without_others && on_other(point, occluders))) continue;
      bins_[static_cast<size_t>(y * kSide + x)] = image.bin(px, py);
    }
  }
}

}  // namespace sightline::observe
