// SPDX-License-Identifier: Apache-2.0
#include "fuse/update/innovation_bias.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "fuse/update/gating.hpp"

namespace sightline::fuse {
namespace {

constexpr double kGain = 0.1;    // of a frame
constexpr double kMinCount = 6;  // frames before a camera is compared
constexpr double kMargin = 2.0;  // times what white innovations leave of the mean
// Of a frame's covariance. By 20 recordings of one camera (docs/accuracy.md).
constexpr double kPersistent = 1.5;
constexpr double kMinShare = 1e-4, kMaxShare = 9.0;
constexpr double kStep = 1.4;  // of the share: a fifth of the sigma

Matrix6 bounded(const InformationInnovation& innovation) {
  Matrix6 information = innovation.information.cast<double>();
  information.diagonal() += anywhere_covariance().diagonal().cwiseInverse();
  return information;
}

// One direction in which a camera's mean innovation is compared with the others': independent of
// its other ones, in units of the camera's own sigma.
struct Direction {
  double squared = 0;     // mean innovation
  double systematic = 0;  // variance that the largest systematic error would add
  double white = 0;       // variance that white innovations leave of the mean
};

class Directions {
 public:
  // `apart`: the camera's mean innovation in information form, less what all have in common.
  void add(const CameraRecord& record, const Vector6& apart, const Matrix6& systematic) {
    const Eigen::LLT<Matrix6> root(bounded(record.mean_innovation));
    const Matrix6 l = root.matrixL();
    const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(l.transpose() * systematic * l);
    const Vector6 whitened = eigen.eigenvectors().transpose() * root.matrixL().solve(apart);
    const double white = kMargin * record.innovation_power / (6 * (2 * record.innovations - 1));
    for (int i = 0; i < 6; ++i) {
      all_[count_++] = {whitened[i] * whitened[i], std::max(0.0, eigen.eigenvalues()[i]), white};
    }
  }

  // The share of the systematic variance that makes what was seen likeliest; `left`: of the
  // variance, after the common part was taken out. Tried in steps: there can be two maxima.
  double likeliest_share(double left) const {
    double best = 0, most = log_likelihood(0, left);
    for (double share = kMinShare; share < kMaxShare; share *= kStep) {
      const double value = log_likelihood(share, left);
      if (value <= most) continue;
      best = share;
      most = value;
    }
    return best;
  }

 private:
  // Times two, without its constant.
  double log_likelihood(double share, double left) const {
    double sum = 0;
    for (size_t i = 0; i < count_; ++i) {
      const Direction& d = all_[i];
      const double variance = share * d.systematic + d.white + 1e-12;
      sum -= std::log(variance) + d.squared / (left * variance);
    }
    return sum;
  }

  std::array<Direction, 6 * 64> all_;
  size_t count_ = 0;
};

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

void add_innovation(const InformationInnovation& innovation, CameraRecord& record) {
  record.innovations = std::min(record.innovations + 1, 1 / kGain);
  const double gain = 1 / record.innovations;
  const auto share = static_cast<float>(gain);
  record.mean_innovation.vector += share * (innovation.vector - record.mean_innovation.vector);
  record.mean_innovation.information +=
      share * (innovation.information - record.mean_innovation.information);
  const Vector6 vector = innovation.vector.cast<double>();
  const double power = vector.dot(bounded(record.mean_innovation).ldlt().solve(vector));
  record.innovation_power += gain * (power - record.innovation_power);
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
  Directions directions;
  for (CameraSet left = compared; left != 0; left &= left - 1) {
    const CameraRecord& record = state.cameras[static_cast<size_t>(std::countr_zero(left))];
    const InformationInnovation& mean = record.mean_innovation;
    const Vector6 apart = mean.vector.cast<double>() - mean.information.cast<double>() * common;
    directions.add(record, apart, systematic);
  }
  return directions.likeliest_share(1.0 - 1.0 / count);
}

Matrix6 persistent_covariance(const CameraRecord& record, const Rigid3& world_from_object) {
  if (record.innovations < kMinCount) return Matrix6::Zero();
  const Matrix6 covariance = bounded(record.mean_innovation).ldlt().solve(Matrix6::Identity());
  const Rigid3 to_object{world_from_object.rotation.inverse(), Eigen::Vector3d::Zero()};
  return kPersistent * to_object.covariance_in_target(covariance);
}

}  // namespace sightline::fuse
