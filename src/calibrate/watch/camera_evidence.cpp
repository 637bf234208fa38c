// SPDX-License-Identifier: Apache-2.0
#include "calibrate/watch/camera_evidence.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace sightline::calibrate {
namespace {

constexpr size_t kMerged = 30;  // fine buckets in a coarse one
constexpr double kScatterGain = 0.05;
constexpr double kScatterClip = 3;  // times its value: a knock is no noise
constexpr size_t kFarLag = 4;       // buckets
// An object that rests repeats the errors of one look; at another place they are others.
constexpr double kPlaceDistance = 0.03, kPlaceAngle = 0.26;  // [m, rad]
constexpr double kRepeatedShare = 0.25;  // of a look's variance that all looks at a place share
constexpr double kRampMargin = 12;       // of the gain
constexpr double kShortestRamp = 40;     // [s]
constexpr size_t kFewest = 2;            // buckets of a course

Matrix6 diagonal(double rotation, double translation) {
  Vector6 d;
  d << Eigen::Vector3d::Constant(rotation), Eigen::Vector3d::Constant(translation);
  return d.asDiagonal();
}

// Squared distance of two independent corrections over its expectation.
double normalized_difference(const Correction& a, const Correction& b) {
  Matrix6 both = a.information + b.information;
  both.diagonal() += 1e-9 * both.diagonal() + Vector6::Constant(1e-9);
  const Eigen::LDLT<Matrix6> solver(both);
  const Matrix6 information = a.information * solver.solve(b.information);
  const Vector6 vector =
      b.information * solver.solve(a.vector) - a.information * solver.solve(b.vector);
  const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(0.5 * (information + information.transpose()));
  const Vector6 along = eigen.eigenvectors().transpose() * vector;
  double squared = 0;
  int dof = 0;
  for (int i = 0; i < 6; ++i) {
    if (eigen.eigenvalues()[i] < 1e-6 * eigen.eigenvalues()[5]) continue;
    squared += along[i] * along[i] / eigen.eigenvalues()[i];
    ++dof;
  }
  return dof > 0 ? squared / dof : 0;
}

// -2 log likelihood ratio of a correction against none, with the variance factor.
double gain_of(const Correction& sum, double scale, const Matrix6& prior) {
  const Matrix6 information = sum.information / scale + prior;
  return sum.vector.dot(information.ldlt().solve(sum.vector)) / (scale * scale);
}

}  // namespace

double CameraEvidence::Scatter::value() const { return weight > 0 ? sum / weight : 1; }

CameraEvidence::CameraEvidence(const CalibrationWatchOptions& options) : options_(options) {
  buckets_.resize(static_cast<size_t>(options.buckets + options.coarse_buckets));
  prior_ = diagonal(1 / (options.prior_rotation * options.prior_rotation),
                    1 / (options.prior_translation * options.prior_translation));
  floor_ = diagonal(options.floor_rotation * options.floor_rotation,
                    options.floor_translation * options.floor_translation);
}

void CameraEvidence::clear() {
  first_ = count_ = coarse_ = 0;
  open_ = Bucket();
  rounds_ = 0;
  near_ = far_ = Scatter();
  placed_ = false;
}

void CameraEvidence::add(Time time, const Correction& correction, const Rigid3& world_from_object) {
  if (open_.rounds == 0) open_.begin = time;
  open_.sum.information += correction.information;
  open_.sum.vector += correction.vector;
  ++open_.rounds;
  ++rounds_;
  if (!placed_ || translation_distance(place_, world_from_object) > kPlaceDistance ||
      rotation_angle(place_, world_from_object) > kPlaceAngle) {
    place_ = world_from_object;
    placed_ = true;
    ++open_.places;
  }
}

bool CameraEvidence::close() {
  if (open_.rounds == 0) return false;
  make_room();
  ++count_;
  at(count_ - 1) = open_;
  open_ = Bucket();
  note_scatter(1, near_);
  note_scatter(kFarLag, far_);
  return true;
}

// The oldest fine buckets become a coarse one, or the oldest coarse one goes.
void CameraEvidence::make_room() {
  if (count_ < buckets_.size()) return;
  if (coarse_ >= static_cast<size_t>(options_.coarse_buckets)) {
    first_ = (first_ + 1) % buckets_.size();
    --count_;
    --coarse_;
    return;
  }
  const size_t merged = std::min(kMerged, count_ - coarse_);
  Bucket& into = at(coarse_);
  for (size_t i = 1; i < merged; ++i) {
    const Bucket& from = at(coarse_ + i);
    into.sum.information += from.sum.information;
    into.sum.vector += from.sum.vector;
    into.rounds += from.rounds;
    into.places += from.places;
  }
  for (size_t i = coarse_ + merged; i < count_; ++i) at(i - merged + 1) = at(i);
  count_ -= merged - 1;
  ++coarse_;
}

void CameraEvidence::note_scatter(size_t lag, Scatter& scatter) {
  if (count_ <= lag) return;
  const double now = normalized_difference(at(count_ - 1).sum, at(count_ - 1 - lag).sum);
  const double clipped = std::min(now, kScatterClip * std::max(1.0, scatter.value()));
  scatter.sum = (1 - kScatterGain) * scatter.sum + clipped;
  scatter.weight = (1 - kScatterGain) * scatter.weight + 1;
}

double CameraEvidence::scale() const { return std::max({1.0, near_.value(), far_.value()}); }

void CameraEvidence::forget_since(Time time) {
  while (count_ > 0 && at(count_ - 1).begin + options_.bucket > time) --count_;
  coarse_ = std::min(coarse_, count_);
  open_ = Bucket();
}

void CameraEvidence::forget_before(size_t keep) {
  if (keep >= count_) return;
  const size_t gone = count_ - keep;
  first_ = (first_ + gone) % buckets_.size();
  count_ = keep;
  coarse_ -= std::min(coarse_, gone);
}

void CameraEvidence::forget_until(Time time) {
  size_t keep = 0;
  while (keep < count_ && at(count_ - 1 - keep).begin >= time) ++keep;
  forget_before(keep);
}

Matrix6 CameraEvidence::round_information() const {
  Matrix6 sum = Matrix6::Zero();
  int rounds = 0;
  for (size_t i = count_ - std::min<size_t>(count_, 30); i < count_; ++i) {
    sum += at(i).sum.information;
    rounds += at(i).rounds;
  }
  return sum / std::max(1, rounds);
}

CorrectionFit CameraEvidence::finish(const Correction& sum, int rounds, int places) const {
  CorrectionFit fit;
  const double s = scale();
  const Eigen::LDLT<Matrix6> solver(Matrix6(sum.information / s + prior_));
  const Vector6 vector = sum.vector / s;
  fit.correction = solver.solve(vector);
  fit.gain = vector.dot(fit.correction);
  // What one place's looks have in common is not averaged out.
  const double repeated =
      1 + kRepeatedShare * rounds / std::max(1, std::min(places, std::max(1, rounds)));
  fit.covariance =
      Matrix6(sum.information / (s * repeated) + prior_).ldlt().solve(Matrix6::Identity());
  const Matrix6 uncertain = fit.covariance + floor_;
  fit.significance = fit.correction.dot(uncertain.ldlt().solve(fit.correction));
  fit.covariance = uncertain;
  return fit;
}

CorrectionFit CameraEvidence::fit_newest(size_t buckets) const {
  Correction sum;
  int rounds = 0, places = 0;
  for (size_t i = count_ - std::min(count_, buckets); i < count_; ++i) {
    sum.information += at(i).sum.information;
    sum.vector += at(i).sum.vector;
    rounds += at(i).rounds;
    places += at(i).places;
  }
  return finish(sum, rounds, places);
}

// A step at bucket k: sums of all later ones. A ramp that begins there weighs bucket i by its age
// t_i - t_k; with S1 = sum L_i, St = sum t_i L_i, Stt = sum t_i^2 L_i its sum is
// Stt - 2 t_k St + t_k^2 S1. Times count from the newest bucket.
CourseFit CameraEvidence::fit_course() const {
  struct Best {
    CourseFit fit;
    Correction sum;
    int rounds = 0, places = 0;
  } step, ramp;
  if (count_ < kFewest) return step.fit;
  const Time end = at(count_ - 1).begin + options_.bucket;
  Correction ones, firsts;
  Matrix6 seconds = Matrix6::Zero();
  int rounds = 0, places = 0;
  const double s = scale();
  const auto consider = [&](const Correction& sum, size_t from, Best& best) {
    const double gain = gain_of(sum, s, prior_);
    if (gain <= best.fit.gain) return;
    best.fit.gain = gain;
    best.fit.from = from;
    best.sum = sum;
    best.rounds = rounds;
    best.places = places;
  };
  const auto seconds_before_end = [&](size_t i) { return to_seconds(end - at(i).begin); };
  for (size_t i = count_; i-- > 0;) {
    const Bucket& bucket = at(i);
    const double t = to_seconds(bucket.begin + options_.bucket / 2 - end);
    ones.information += bucket.sum.information;
    ones.vector += bucket.sum.vector;
    firsts.information += t * bucket.sum.information;
    firsts.vector += t * bucket.sum.vector;
    seconds += t * t * bucket.sum.information;
    rounds += bucket.rounds;
    places += bucket.places;
    if (count_ - i < kFewest) continue;
    consider(ones, i, step);
    const double length = seconds_before_end(i);
    if (length < kShortestRamp) continue;
    // Weights (t + length) / length, 1 today.
    consider({(seconds + 2 * length * firsts.information + length * length * ones.information) /
                  (length * length),
              (firsts.vector + length * ones.vector) / length},
             i, ramp);
  }
  const bool ramps = ramp.fit.gain > step.fit.gain + kRampMargin;
  Best& best = ramps ? ramp : step;
  best.fit.now = finish(best.sum, best.rounds, best.places);
  if (ramps) {
    best.fit.ramp = true;
    best.fit.rate = best.fit.now.correction / seconds_before_end(best.fit.from);
  }
  return best.fit;
}

}  // namespace sightline::calibrate
