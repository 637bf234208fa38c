// SPDX-License-Identifier: Apache-2.0
#include "fuse/update/innovation_bias.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <bit>
#include <cmath>

namespace sightline::fuse {
namespace {

constexpr double kGain = 0.1;    // of a frame
constexpr double kMinCount = 6;  // frames before a camera is compared
constexpr double kMargin = 2.5;  // times what white innovations leave of the mean
constexpr double kMaxShare = 9.0;

// Metric for information vectors: inverse of the covariance that the largest systematic error and
// the camera's noise would give one.
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

InformationInnovation innovation_of(const PoseMinimum& minimum, size_t index) {
  const CameraSystem& system = minimum.systems[index];
  Matrix6 to_world = Matrix6::Zero();
  to_world.topLeftCorner<3, 3>() = minimum.pose.rotation_matrix();
  to_world.bottomRightCorner<3, 3>() = to_world.topLeftCorner<3, 3>();
  const Vector6 vector = system.information * minimum.offset - system.gradient;
  const Matrix6 information = to_world * system.information * to_world.transpose();
  return {(to_world * vector).cast<float>(), information.cast<float>()};
}

void add_innovation(const InformationInnovation& innovation, const EstimatorOptions& options,
                    CameraRecord& record) {
  record.innovations = std::min(record.innovations + 1, 1 / kGain);
  const double gain = 1 / record.innovations;
  const auto share = static_cast<float>(gain);
  record.mean_innovation.vector += share * (innovation.vector - record.mean_innovation.vector);
  record.mean_innovation.information +=
      share * (innovation.information - record.mean_innovation.information);
  const Matrix6 metric =
      metric_of(record.mean_innovation.information.cast<double>(), systematic_covariance(options));
  const Vector6 vector = innovation.vector.cast<double>();
  record.innovation_power += gain * (vector.dot(metric * vector) - record.innovation_power);
}

double bias_share(CameraSet cameras, const EstimatorOptions& options, const BankState& state) {
  Matrix6 information = Matrix6::Identity() * 1e-9;
  Vector6 vector = Vector6::Zero();
  CameraSet compared = 0;
  for (CameraSet left = cameras; left != 0; left &= left - 1) {
    const auto index = static_cast<size_t>(std::countr_zero(left));
    const CameraRecord& record = state.cameras[index];
    if (record.innovations < kMinCount) continue;
    compared |= CameraSet{1} << index;
    information += record.mean_innovation.information.cast<double>();
    vector += record.mean_innovation.vector.cast<double>();
  }
  const int count = std::popcount(compared);
  if (count < 2) return state.bias_share;
  // What all have in common is motion that the prediction lags behind.
  const Vector6 common = information.ldlt().solve(vector);
  const Matrix6 systematic = systematic_covariance(options);
  double squares = 0, expected = 0, unit = 0;
  for (CameraSet left = compared; left != 0; left &= left - 1) {
    const CameraRecord& record = state.cameras[static_cast<size_t>(std::countr_zero(left))];
    const Matrix6 own = record.mean_innovation.information.cast<double>();
    const Matrix6 metric = metric_of(own, systematic);
    const Vector6 apart = record.mean_innovation.vector.cast<double>() - own * common;
    squares += apart.dot(metric * apart);
    expected += record.innovation_power / (2 * record.innovations - 1);
    unit += (metric * own * systematic * own).trace();
  }
  unit *= 1.0 - 1.0 / count;
  return std::clamp((squares - kMargin * expected) / std::max(unit, 1e-9), 0.0, kMaxShare);
}

}  // namespace sightline::fuse
