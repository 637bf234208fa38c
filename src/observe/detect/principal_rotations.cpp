// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/principal_rotations.hpp"

#include <Eigen/Eigenvalues>

namespace sightline::observe {

std::vector<Eigen::Quaterniond> principal_rotations(const ViewpointModel& model) {
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

}  // namespace sightline::observe
