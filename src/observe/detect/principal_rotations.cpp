// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/principal_rotations.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <numbers>
#include <optional>

namespace sightline::observe {
namespace {

constexpr int kTurnStep = 15;   // [deg]
constexpr int kLeastTurn = 30;  // what is nearer is where a fit from the pose leads
constexpr double kSameAxisCosine = 0.95;

// As columns.
Eigen::Matrix3d principal_axes(const ViewpointModel& model) {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (size_t i = 0; i < model.size(); ++i) {
    for (const ContourSample& sample : model.view(i).contour) {
      const Eigen::Vector3d from_center = sample.point.cast<double>() - model.center();
      spread += from_center * from_center.transpose();
    }
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(spread);
  Eigen::Matrix3d axes = principal.eigenvectors();
  if (axes.determinant() < 0) axes.col(2) *= -1;
  return axes;
}

bool round_about(const ViewpointModel& model, const Eigen::Vector3d& axis) {
  const auto along = [&](const std::optional<ShapeSymmetry::Axis>& other) {
    return other && std::abs(other->direction.dot(axis)) > kSameAxisCosine;
  };
  return along(model.near_axis()) || along(model.symmetry_axis());
}

}  // namespace

std::vector<Eigen::Quaterniond> principal_rotations(const ViewpointModel& model) {
  const Eigen::Matrix3d axes = principal_axes(model);
  std::vector<Eigen::Quaterniond> rotations;
  for (int first = 0; first < 6; ++first) {
    for (int second = 0; second < 6; ++second) {
      if (first / 2 == second / 2) continue;
      Eigen::Matrix3d turn;
      turn.col(0) = (first % 2 == 0 ? 1 : -1) * Eigen::Vector3d::Unit(first / 2);
      turn.col(1) = (second % 2 == 0 ? 1 : -1) * Eigen::Vector3d::Unit(second / 2);
      turn.col(2) = turn.col(0).cross(turn.col(1));
      if (turn.isIdentity()) continue;
      rotations.emplace_back(axes * turn * axes.transpose());
    }
  }
  return rotations;
}

std::vector<Eigen::Quaterniond> principal_turns(const ViewpointModel& model) {
  const Eigen::Matrix3d axes = principal_axes(model);
  std::vector<Eigen::Quaterniond> turns;
  for (int i = 0; i < 3; ++i) {
    if (round_about(model, axes.col(i))) continue;
    for (int turn = kLeastTurn; turn <= 360 - kLeastTurn; turn += kTurnStep) {
      if (turn % 90 == 0) continue;
      const double angle = turn * std::numbers::pi / 180;
      turns.emplace_back(Eigen::AngleAxisd(angle, axes.col(i)));
    }
  }
  return turns;
}

}  // namespace sightline::observe
