// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/lookalikes.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline {
namespace {

constexpr double kSameTurn = 0.1;  // [rad]

std::vector<Eigen::Quaterniond> declared_turns(const ObjectDescription& object) {
  std::vector<Eigen::Quaterniond> turns = {Eigen::Quaterniond::Identity()};
  if (object.symmetry != Symmetry::kDiscrete) return turns;
  for (int i = 1; i < object.symmetry_order; ++i) {
    const double angle = 2 * std::numbers::pi * i / object.symmetry_order;
    turns.emplace_back(Eigen::AngleAxisd(angle, object.symmetry_axis.normalized()));
  }
  return turns;
}

}  // namespace

Lookalikes lookalikes_of(const ViewpointModel& views, const ObjectDescription& object) {
  Lookalikes out;
  const Eigen::Vector3d axis = object.symmetry_axis.normalized();
  if (object.symmetry == Symmetry::kAxis) {
    out.axis = {axis, Eigen::Vector3d::Zero(), true};
  } else if (views.symmetry_axis()) {
    out.axis = views.symmetry_axis();
  }
  const auto declared = declared_turns(object);
  const auto same = [&](const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
    if (out.axis) {
      const Eigen::Vector3d u = a * out.axis->direction, v = b * out.axis->direction;
      return std::atan2(u.cross(v).norm(), u.dot(v)) < kSameTurn;
    }
    return std::any_of(declared.begin(), declared.end(), [&](const Eigen::Quaterniond& turn) {
      return a.angularDistance(b * turn) < kSameTurn;
    });
  };
  for (const Rigid3& turn : views.turns()) {
    if (out.turns.size() == Lookalikes::kMost) break;
    if (same(turn.rotation, Eigen::Quaterniond::Identity())) continue;
    const bool known = std::any_of(out.turns.begin(), out.turns.end(), [&](const Rigid3& other) {
      return same(turn.rotation, other.rotation);
    });
    if (!known) out.turns.push_back(turn);
  }
  return out;
}

}  // namespace sightline
