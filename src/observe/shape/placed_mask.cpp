// SPDX-License-Identifier: Apache-2.0
#include "observe/shape/placed_mask.hpp"

#include <bit>
#include <cmath>

#include "sightline/geometry/rotation_between.hpp"

namespace sightline::observe {
namespace {

constexpr int kSide = ViewpointModel::kMaskSize;

int cells_of(const ViewpointModel::Mask& mask) {
  int sum = 0;
  for (const uint32_t row : mask) sum += std::popcount(row);
  return sum;
}

double square(double side) { return side * side; }

}  // namespace

std::optional<PlacedMask> place_mask(const ViewpointModel& model, const CameraModel& camera,
                                     const Rigid3& camera_from_object) {
  const Eigen::Vector3d center = camera_from_object * model.center();
  const double distance = center.norm();
  if (center.z() < 0.01 * distance || distance < 1.01 * model.radius()) return std::nullopt;
  const auto pixel = camera.project(center);
  if (!pixel) return std::nullopt;
  PlacedMask out;
  out.view = model.nearest(camera_from_object);
  const Eigen::Matrix3d along_ray =
      rotation_between(center, Eigen::Vector3d::UnitZ()).toRotationMatrix() *
      camera_from_object.rotation_matrix();
  const Eigen::Matrix3d turn =
      along_ray * model.view(out.view).camera_from_object.rotation_matrix().transpose();
  const double angle = std::atan2(turn(1, 0) - turn(0, 1), turn(0, 0) + turn(1, 1));
  out.x = pixel->x();
  out.y = pixel->y();
  out.radius = camera.parameters().fx * model.radius() / distance;
  out.cos = std::cos(angle);
  out.sin = std::sin(angle);
  return out;
}

double silhouette_overlap(const ViewpointModel& first, const PlacedMask& first_at,
                          const ViewpointModel& second, const PlacedMask& second_at) {
  const ViewpointModel::Mask& one = first.mask(first_at.view);
  const ViewpointModel::Mask& two = second.mask(second_at.view);
  const double cell = 2 * first_at.radius / kSide, other_cell = 2 * second_at.radius / kSide;
  int common = 0;
  for (int j = 0; j < kSide; ++j) {
    for (int i = 0; i < kSide; ++i) {
      if ((one[static_cast<size_t>(j)] >> i & 1u) == 0) continue;
      const double u = cell * (i - 0.5 * (kSide - 1)), v = cell * (j - 0.5 * (kSide - 1));
      const double dx = first_at.x + first_at.cos * u - first_at.sin * v - second_at.x;
      const double dy = first_at.y + first_at.sin * u + first_at.cos * v - second_at.y;
      const double x = (second_at.cos * dx + second_at.sin * dy) / other_cell + 0.5 * kSide;
      const double y = (second_at.cos * dy - second_at.sin * dx) / other_cell + 0.5 * kSide;
      if (!(x >= 0 && y >= 0 && x < kSide && y < kSide)) continue;
      common += two[static_cast<size_t>(y)] >> static_cast<int>(x) & 1u ? 1 : 0;
    }
  }
  const double shared = common * square(cell);
  const double all = cells_of(one) * square(cell) + cells_of(two) * square(other_cell) - shared;
  return all > 0 ? shared / all : 0;
}

}  // namespace sightline::observe
