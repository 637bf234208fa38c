// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/turn/turn_filter.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "sightline/base/check.hpp"

namespace sightline {
namespace {

constexpr double kGate = 13.8;              // chi^2 of two: one of a thousand good ones is refused
constexpr double kSuspicion = 2;            // sigmas
constexpr double kContradiction = 3;        // sigmas
constexpr double kLeastConfigured = 0.001;  // [s]: nobody measures a latency better by other means
constexpr double kMaxLatency = 0.6;         // [s]
constexpr double kDrift = 2e-5;             // [rad/sqrt(s)] by which keyframes may come off
constexpr double kLatencyDrift = 2e-4;      // [sqrt(s)]
constexpr double kDoubt = 0.002;            // [s]
constexpr double kSlow = 4;                 // variance of readings of which a step takes frames

double square(double x) { return x * x; }

}  // namespace

TurnFilter::TurnFilter(const Options& options) : options_(options) {
  covariance_.setZero(1, 1);
  covariance_(0, 0) = square(std::max(kLatencySigma, options.latency_sigma_s));
  mean_.setZero(1);
  mean_(0) = options.latency_s;
  used_.setConstant(1e9);
}

double TurnFilter::latency_sigma() const { return std::sqrt(std::max(covariance_(0, 0), 0.0)); }

bool TurnFilter::latency_contradicted() const {
  const double both = std::hypot(latency_sigma(), options_.latency_sigma_s);
  return latency_known() &&
         std::abs(latency() - options_.latency_s) > kContradiction * both + kTolerance;
}

bool TurnFilter::latency_suspect() const {
  const double both = std::hypot(latency_sigma(), options_.latency_sigma_s);
  return !latency_known() && std::abs(latency() - options_.latency_s) > kSuspicion * both;
}

double TurnFilter::used_latency() const {
  if (!latency_known()) return options_.latency_s;
  if (latency_contradicted()) return latency();
  const double configured = square(std::max(options_.latency_sigma_s, kLeastConfigured));
  const double share = configured / (configured + covariance_(0, 0));
  return options_.latency_s + share * (latency() - options_.latency_s);
}

double TurnFilter::used_latency_sigma() const {
  if (!latency_known()) return options_.latency_sigma_s;
  if (latency_contradicted()) return latency_sigma();
  const double configured = square(std::max(options_.latency_sigma_s, kLeastConfigured));
  return std::sqrt(configured * covariance_(0, 0) / (configured + covariance_(0, 0)));
}

KeyframeView TurnFilter::view(size_t index) const {
  const auto at = first_of(index);
  SL_CHECK(at + 3 <= mean_.size(), "no such keyframe");
  return {mean_.segment<2>(at), std::max(mean_(at + 2), 0.0)};
}

void TurnFilter::clear_keyframes() {
  mean_.conservativeResize(1);
  covariance_.conservativeResize(1, 1);
  used_.setConstant(1e9);
}

// Its place in the state, without a connection to the others.
void TurnFilter::reserve(size_t index) {
  const auto at = first_of(index), old = mean_.size();
  SL_CHECK(index < Panorama::kMaxKeyframes && at <= old, "keyframes are added in order");
  if (at == old) {
    mean_.conservativeResize(old + 3);
    covariance_.conservativeResize(old + 3, old + 3);
  }
  covariance_.middleRows(at, 3).setZero();
  covariance_.middleCols(at, 3).setZero();
  mean_(at + 2) = kInverseDepth;
  covariance_(at + 2, at + 2) = square(kDepthSigma);
}

// A frame that has just come is extrapolated; the readings that this is made from come again when
// the frame is learned from, so it is not to weigh much.
void TurnFilter::add_by_encoder(size_t index, const EncoderAngles& encoder) {
  reserve(index);
  const auto at = first_of(index), size = mean_.size();
  mean_.segment<2>(at) = at_latency(encoder);
  const Eigen::RowVectorXd latency = covariance_.row(0);
  for (Eigen::Index i = 0; i < size; ++i) {
    if (i >= at && i < at + 3) continue;
    covariance_.block<2, 1>(at, i) = encoder.rates * latency(i);
    covariance_.block<1, 2>(i, at) = covariance_.block<2, 1>(at, i).transpose();
  }
  covariance_.block<2, 2>(at, at) = encoder.rates * latency(0) * encoder.rates.transpose();
  covariance_.block<2, 2>(at, at).diagonal() += 9 * encoder.sigmas.cwiseAbs2();
}

void TurnFilter::add_by_picture(size_t index, size_t by, const PictureAngles& picture) {
  SL_CHECK(index != by, "a keyframe does not replace what it is seen by");
  reserve(index);
  const auto at = first_of(index), from = first_of(by), size = mean_.size();
  mean_.segment<2>(at) = picture.angles;
  Eigen::Matrix<double, 2, 3> slopes;
  slopes << picture.by_keyframe, picture.by_depth;
  const Eigen::Matrix<double, 3, Eigen::Dynamic> rows = covariance_.middleRows(from, 3);
  for (Eigen::Index i = 0; i < size; ++i) {
    if (i >= at && i < at + 3) continue;
    covariance_.block<2, 1>(at, i) = slopes * rows.col(i);
    covariance_.block<1, 2>(i, at) = covariance_.block<2, 1>(at, i).transpose();
  }
  covariance_.block<2, 2>(at, at) =
      slopes * rows.middleCols(from, 3) * slopes.transpose() + picture.covariance;
}

Eigen::Vector4d TurnFilter::part(size_t keyframe) const {
  Eigen::Vector4d out;
  out << mean_(0), mean_.segment<3>(first_of(keyframe));
  return out;
}

TurnFilter::Block TurnFilter::block(size_t keyframe) const {
  const auto at = first_of(keyframe);
  Block out;
  out(0, 0) = covariance_(0, 0);
  out.block<1, 3>(0, 1) = covariance_.block<1, 3>(0, at);
  out.block<3, 1>(1, 0) = covariance_.block<3, 1>(at, 0);
  out.block<3, 3>(1, 1) = covariance_.block<3, 3>(at, at);
  return out;
}

// Of encoder less picture: d(latency) moves the frame along the readings.
Eigen::Matrix<double, 2, 4> TurnFilter::difference_slopes(const EncoderAngles& encoder,
                                                          const PictureAngles& picture) const {
  Eigen::Matrix<double, 2, 4> out;
  out << encoder.rates, -picture.by_keyframe, -picture.by_depth;
  return out;
}

// Along the readings to the latency as it is known now.
Eigen::Vector2d TurnFilter::at_latency(const EncoderAngles& encoder) const {
  return encoder.angles + encoder.rates * (latency() - encoder.latency_s);
}

void TurnFilter::doubt_latency() { covariance_(0, 0) += square(kDoubt); }

// State s = (latency, keyframe): angles = picture + P s + n_p = encoder + E s + n_e. Without the
// configured latency until the found one is better: that is one more measurement of s.
std::optional<TurnedAngles> TurnFilter::fuse(const EncoderAngles& encoder, size_t keyframe,
                                             const PictureAngles& picture) const {
  Block state = block(keyframe);
  Eigen::Vector4d mean = Eigen::Vector4d::Zero();
  if (!latency_contradicted()) {
    const double sigma = latency_known() ? std::max(options_.latency_sigma_s, kLeastConfigured)
                                         : options_.latency_sigma_s;
    const Eigen::Vector4d gain = state.col(0) / (state(0, 0) + square(sigma) + 1e-12);
    mean = gain * (options_.latency_s - latency());
    state -= (gain * state.row(0)).eval();
  }
  Eigen::Matrix<double, 2, 4> by_picture = Eigen::Matrix<double, 2, 4>::Zero();
  by_picture << Eigen::Vector2d::Zero(), picture.by_keyframe, picture.by_depth;
  const Eigen::Matrix<double, 2, 4> slopes = difference_slopes(encoder, picture);
  const Eigen::Matrix2d noise = encoder.sigmas.cwiseAbs2().asDiagonal();
  const Eigen::Vector2d apart = picture.angles - at_latency(encoder) - slopes * mean;
  const Eigen::Matrix2d spread = slopes * state * slopes.transpose() + picture.covariance + noise;
  const Eigen::Matrix2d inverse = spread.inverse();
  if (!(apart.dot(inverse * apart) < kGate)) return std::nullopt;
  const Eigen::Matrix2d cross = by_picture * state * slopes.transpose() - picture.covariance;
  TurnedAngles out;
  out.angles = picture.angles + by_picture * mean + cross * inverse * apart;
  out.covariance = by_picture * state * by_picture.transpose() + picture.covariance -
                   cross * inverse * cross.transpose();
  return out;
}

void TurnFilter::update(double residual, const Eigen::RowVector4d& slopes, double variance,
                        size_t keyframe) {
  const auto at = first_of(keyframe);
  State cross = covariance_.col(0) * slopes(0);
  cross.noalias() += covariance_.middleCols(at, 3) * slopes.tail<3>().transpose();
  const double spread = slopes(0) * cross(0) + slopes.tail<3>() * cross.segment<3>(at) + variance;
  const State gain = cross / spread;
  mean_ += gain * residual;
  covariance_.noalias() -= gain * cross.transpose();
  mean_(0) = std::clamp(mean_(0), 0.0, kMaxLatency);
}

// A reading that has not moved on says the same again: of a head that stands, rounding does not
// average out. Where it moves by less than a step between frames it is caught just after a step.
TurnFilter::UpdateResult TurnFilter::learn(const EncoderAngles& encoder, size_t keyframe,
                                           const PictureAngles& picture, double frame_s,
                                           double reach_s) {
  const auto at = first_of(keyframe);
  const double time = std::clamp(frame_s, 0.0, 1.0);
  covariance_(0, 0) += square(kLatencyDrift) * time;
  covariance_.block<2, 2>(at, at).diagonal().array() += square(kDrift) * time;
  const Eigen::Matrix<double, 2, 4> slopes = difference_slopes(encoder, picture);
  const Eigen::Vector2d bent = 0.5 * square(reach_s) * encoder.accelerations;
  const Eigen::Vector2d variances = encoder.sigmas.cwiseAbs2() + bent.cwiseAbs2();
  Eigen::Matrix2d spread = slopes * block(keyframe) * slopes.transpose() + picture.covariance;
  spread.diagonal() += variances;
  const Eigen::Vector2d apart = picture.angles - at_latency(encoder);
  if (!(apart.dot(spread.inverse() * apart) < kGate)) return UpdateResult::kContradicted;
  UpdateResult result = UpdateResult::kNothingNew;
  const Eigen::Vector4d before = part(keyframe);
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    if (std::abs(encoder.angles(axis) - used_(axis)) < options_.step) continue;
    used_(axis) = encoder.angles(axis);
    result = UpdateResult::kApplied;
    const bool slow = std::abs(encoder.rates(axis)) * time < options_.step;
    const double variance = picture.covariance(axis, axis) + (slow ? kSlow : 1) * variances(axis);
    const double known = slopes.row(axis) * (part(keyframe) - before);
    update(apart(axis) - known, slopes.row(axis), variance, keyframe);
  }
  return result;
}

}  // namespace sightline
