// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/shape/shape_symmetry.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline {
namespace {

constexpr double kSameRotation = 0.1;  // [rad]

std::vector<Eigen::Quaterniond> declared_rotations(const ObjectDescription& object) {
  std::vector<Eigen::Quaterniond> rotations = {Eigen::Quaterniond::Identity()};
  if (object.symmetry != Symmetry::kDiscrete) return rotations;
  for (int i = 1; i < object.symmetry_order; ++i) {
    const double angle = 2 * std::numbers::pi * i / object.symmetry_order;
    rotations.emplace_back(Eigen::AngleAxisd(angle, object.symmetry_axis.normalized()));
  }
  return rotations;
}

}  // namespace

ShapeSymmetry shape_symmetry_of(const ViewpointModel& views, const ObjectDescription& object) {
  ShapeSymmetry out;
  const Eigen::Vector3d axis = object.symmetry_axis.normalized();
  if (object.symmetry == Symmetry::kAxis) {
    out.axis = {axis, Eigen::Vector3d::Zero(), true};
  } else if (views.symmetry_axis()) {
    out.axis = views.symmetry_axis();
  }
  const auto declared = declared_rotations(object);
  const auto same = [&](const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
    if (out.axis) {
      const Eigen::Vector3d u = a * out.axis->direction, v = b * out.axis->direction;
      return std::atan2(u.cross(v).norm(), u.dot(v)) < kSameRotation;
    }
    return std::any_of(declared.begin(), declared.end(), [&](const Eigen::Quaterniond& rotation) {
      return a.angularDistance(b * rotation) < kSameRotation;
    });
  };
  for (const Rigid3& transform : views.symmetry_rotations()) {
    if (out.rotations.size() == ShapeSymmetry::kMax) break;
    if (same(transform.rotation, Eigen::Quaterniond::Identity())) continue;
    const bool known =
        std::any_of(out.rotations.begin(), out.rotations.end(),
                    [&](const Rigid3& other) { return same(transform.rotation, other.rotation); });
    if (!known) out.rotations.push_back(transform);
  }
  if (!out.axis) out.near_axis = views.near_axis();
  for (const Rigid3& transform : views.near_rotations()) {
    if (out.rotations.size() + out.near_rotations.size() == ShapeSymmetry::kMax) break;
    if (!same(transform.rotation, Eigen::Quaterniond::Identity())) {
      out.near_rotations.push_back(transform);
    }
  }
  return out;
}

}  // namespace sightline
