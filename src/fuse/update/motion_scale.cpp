// SPDX-License-Identifier: Apache-2.0
#include "fuse/update/motion_scale.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace sightline::fuse {
namespace {

constexpr double kGain = 0.235;  // of the logarithm, per update
// Cameras that expose within it correct the same prediction: their corrections are one.
constexpr Duration kSameInstant = std::chrono::milliseconds(5);
constexpr double kMinScale = 0.0004;  // a fiftieth of the nominal acceleration
// Where the cameras contradict one another, nobody can tell that the motion is that calm.
constexpr double kMinContested = 0.2;
constexpr double kMaxScale = 4.0;
constexpr double kMinDof = 0.05;  // [dof] below: the set says nothing of the prediction

// The offset from a right prediction has the covariance P - P_posterior, so the expectation of
// offset^T P^-1 offset is tr(I - P^-1 P_posterior); so for any block of the pose.
Nis of_block(const Matrix6& prior, const Matrix6& posterior, const Vector6& offset, int at) {
  const Eigen::Matrix3d block = prior.block<3, 3>(at, at);
  const Eigen::LLT<Eigen::Matrix3d> solver(block);
  const Eigen::Vector3d part = offset.segment<3>(at);
  const Eigen::Matrix3d kept = solver.solve(Eigen::Matrix3d(posterior.block<3, 3>(at, at)));
  return {part.dot(solver.solve(part)), 3.0 - kept.trace()};
}

// Cosine of two offsets in the metric of the prediction; 0 if one of them is nothing.
double alignment(const Matrix6& information, const Vector6& a, const Vector6& b, int at) {
  const Eigen::Matrix3d metric = information.block<3, 3>(at, at);
  const Eigen::Vector3d x = a.segment<3>(at), y = b.segment<3>(at);
  const double product = x.dot(metric * x) * y.dot(metric * y);
  return product > 0 ? x.dot(metric * y) / std::sqrt(product) : 0.0;
}

double learned(double alignment, double min, double scale) {
  return std::clamp(scale * std::exp(kGain * alignment), min, kMaxScale);
}

double raised(const Nis& nis, double scale) {
  if (nis.dof < kMinDof || nis.squared < nis.dof) return scale;
  return std::min(std::max(1.0, scale), scale * nis.squared / nis.dof);
}

}  // namespace

PoseNis normalized_innovation(const PoseMinimum& minimum) {
  const Matrix6 prior = minimum.prior_information.ldlt().solve(Matrix6::Identity());
  const Matrix6 posterior = minimum.information().ldlt().solve(Matrix6::Identity());
  const Matrix6 kept = minimum.prior_information * posterior;
  return {{2.0 * minimum.prior_cost, 6.0 - kept.trace()},
          of_block(prior, posterior, minimum.offset, 0),
          of_block(prior, posterior, minimum.offset, 3)};
}

MotionNoise scaled(const MotionNoise& nominal, const MotionScale& scale) {
  return {nominal.angular * std::sqrt(scale.angular), nominal.linear * std::sqrt(scale.linear)};
}

void learn(Time time, const PoseMinimum& minimum, int cameras, double systematic,
           MotionMemory& memory, MotionScale& scale) {
  const double min = std::min(kMinContested, kMinScale * systematic);
  if (time - memory.since <= kSameInstant) {
    memory.offset += minimum.offset;
    return;
  }
  const Matrix6& metric = minimum.prior_information;
  scale = {learned(alignment(metric, memory.offset, memory.before, 0), min, scale.angular),
           learned(alignment(metric, memory.offset, memory.before, 3), min, scale.linear)};
  const double kept = std::max(0.0, 1.0 - 2.0 / std::max(1, cameras));
  memory = {time, minimum.offset, kept * memory.before + memory.offset};
}

MotionScale raised(const PoseNis& nis, const MotionScale& scale) {
  return {raised(nis.rotation, scale.angular), raised(nis.translation, scale.linear)};
}

MotionScale at_least_nominal(const MotionScale& scale) {
  return {std::max(1.0, scale.angular), std::max(1.0, scale.linear)};
}

}  // namespace sightline::fuse
