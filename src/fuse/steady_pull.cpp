// SPDX-License-Identifier: Apache-2.0
#include "steady_pull.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <bit>
#include <cmath>

namespace sightline::fuse {
namespace {

constexpr double kGain = 0.1;    // of a look
constexpr double kFewest = 6;    // looks before a camera is compared
constexpr double kMargin = 2.5;  // times what white innovations leave of the mean
constexpr double kMostShare = 9.0;

// Metric for forces: inverse of the covariance that one of the largest systematic error and one of
// the camera's noise would have.
Matrix6 metric_of(const Matrix6& information, const Matrix6& systematic) {
  Matrix6 covariance = information * systematic * information + information;
  covariance.diagonal().array() += 1e-9 * covariance.diagonal().maxCoeff() + 1e-12;
  return covariance.ldlt().solve(Matrix6::Identity());
}

}  // namespace

Matrix6 systematic_covariance(const EstimatorOptions& options) {
  Vector6 sigma;
  sigma << Eigen::Vector3d::Constant(options.systematic_rotation),
      Eigen::Vector3d::Constant(options.systematic_translation);
  return sigma.cwiseAbs2().asDiagonal();
}

Pull pull_of(const PoseMinimum& minimum, size_t index) {
  const CameraSystem& system = minimum.systems[index];
  Matrix6 to_world = Matrix6::Zero();
  to_world.topLeftCorner<3, 3>() = minimum.pose.rotation_matrix();
  to_world.bottomRightCorner<3, 3>() = to_world.topLeftCorner<3, 3>();
  const Vector6 force = system.information * minimum.offset - system.gradient;
  const Matrix6 information = to_world * system.information * to_world.transpose();
  return {(to_world * force).cast<float>(), information.cast<float>()};
}

void remember(const Pull& pull, const EstimatorOptions& options, CameraRecord& record) {
  record.pulls = std::min(record.pulls + 1, 1 / kGain);
  const double gain = 1 / record.pulls;
  const auto share = static_cast<float>(gain);
  record.pull.force += share * (pull.force - record.pull.force);
  record.pull.information += share * (pull.information - record.pull.information);
  const Matrix6 metric =
      metric_of(record.pull.information.cast<double>(), systematic_covariance(options));
  const Vector6 force = pull.force.cast<double>();
  record.pull_square += gain * (force.dot(metric * force) - record.pull_square);
}

double steady_share(CameraSet cameras, const EstimatorOptions& options, const BankState& state) {
  Matrix6 information = Matrix6::Identity() * 1e-9;
  Vector6 force = Vector6::Zero();
  CameraSet compared = 0;
  for (CameraSet left = cameras; left != 0; left &= left - 1) {
    const auto index = static_cast<size_t>(std::countr_zero(left));
    const CameraRecord& record = state.cameras[index];
    if (record.pulls < kFewest) continue;
    compared |= CameraSet{1} << index;
    information += record.pull.information.cast<double>();
    force += record.pull.force.cast<double>();
  }
  const int count = std::popcount(compared);
  if (count < 2) return state.steady;
  // What all have in common is motion that the prediction lags behind.
  const Vector6 common = information.ldlt().solve(force);
  const Matrix6 systematic = systematic_covariance(options);
  double squares = 0, expected = 0, unit = 0;
  for (CameraSet left = compared; left != 0; left &= left - 1) {
    const CameraRecord& record = state.cameras[static_cast<size_t>(std::countr_zero(left))];
    const Matrix6 own = record.pull.information.cast<double>();
    const Matrix6 metric = metric_of(own, systematic);
    const Vector6 apart = record.pull.force.cast<double>() - own * common;
    squares += apart.dot(metric * apart);
    expected += record.pull_square / (2 * record.pulls - 1);
    unit += (metric * own * systematic * own).trace();
  }
  unit *= 1.0 - 1.0 / count;
  return std::clamp((squares - kMargin * expected) / std::max(unit, 1e-9), 0.0, kMostShare);
}

}  // namespace sightline::fuse
