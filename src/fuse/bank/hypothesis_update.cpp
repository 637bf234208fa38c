// SPDX-License-Identifier: Apache-2.0
#include "fuse/bank/hypothesis_update.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "fuse/bank/prediction.hpp"
#include "fuse/update/chi_square.hpp"
#include "fuse/update/motion_scale.hpp"

namespace sightline::fuse {
namespace {

constexpr double kNisAlarm = 16.8;  // 99 % of chi-square with 6 dof
// Power of the accelerations of a maneuver, next to the nominal ones: 60 mm + 13 deg in 1/30 s, one
// sigma. Over a longer gap no more than that: anything may be anywhere then.
constexpr double kManeuver = 64, kManeuverSeconds = 1.0 / 30;

}  // namespace

HypothesisUpdate::HypothesisUpdate(const EstimatorOptions& options,
                                   const SymmetricHypotheses& symmetric)
    : options_(options),
      symmetric_(symmetric),
      gating_(options),
      nis_limit_(chi_square_quantile(options.gate_probability, 6)) {}

bool HypothesisUpdate::too_loose(const PoseEstimate& estimate) const {
  return estimate.own_sigma_translation() > options_.reacquire_sigma_translation ||
         estimate.own_sigma_rotation() > options_.reacquire_sigma_rotation;
}

// The hypothesis after the set has told which of the symmetric poses it is. All of them move in the
// same way, so the choice can be made before the prediction.
Hypothesis HypothesisUpdate::with_symmetry_evidence(const Hypothesis& hypothesis,
                                                    const MeasurementSet& set) const {
  Hypothesis out = hypothesis;
  const PoseEstimate estimate = predicted(hypothesis, set.time, hypothesis.motion, options_);
  symmetric_.allow_motion(estimate.own_covariance(), out);
  symmetric_.add_evidence(set.observations, estimate.world_from_object, out);
  symmetric_.choose(out);
  return out;
}

void HypothesisUpdate::run(const Hypothesis& hypothesis, const MeasurementSet& set,
                           std::vector<Outcome>& outcomes) {
  const Hypothesis known =
      symmetric_.size() > 1 ? with_symmetry_evidence(hypothesis, set) : hypothesis;
  Hypothesis moved = known;
  moved.estimate = predicted(known, set.time, known.motion, options_);
  if (too_loose(moved.estimate)) {
    reacquire(moved, set, outcomes);
    return;
  }
  gating_.run(pose_prior(moved.estimate), set.measurements, moved.estimate.world_from_object,
              update_);
  const MotionScale needed = needed_motion(update_, known.motion);
  if (needed != known.motion) {
    // Livelier than it was of late: predict once more with that in mind. If that does not settle
    // it, it was not the motion.
    const PoseEstimate calm = moved.estimate;
    std::swap(update_, calm_update_);
    moved.motion = needed;
    moved.estimate = predicted(known, set.time, needed, options_);
    gating_.run(pose_prior(moved.estimate), set.measurements, moved.estimate.world_from_object,
                update_);
    if (update_.inconsistent && calm_update_.accepted != 0) {
      std::swap(update_, calm_update_);
      moved.motion = known.motion;
      moved.estimate = calm;
    } else if (calm_update_.accepted == 0 && std::popcount(update_.accepted) == 1) {
      moved.confirmations = 0;
    }
  }
  // Cameras that agree with one another, but not with what was believed, do not move it.
  if (update_.accepted != 0 && 2.0 * update_.minimum.prior_cost > nis_limit_) {
    update_.gated |= std::exchange(update_.accepted, 0);
  }
  const bool maneuvered = update_.accepted == 0 && follow_maneuver(known, set, moved);
  if (update_.accepted == 0) moved.motion = known.motion;
  outcomes.push_back(outcome_of(moved, update_, set, symmetric_, options_));
  if (maneuvered) forget_velocity(known.estimate.twist, outcomes.back().hypothesis.estimate);
}

// Nobody expected it there, but that is where all that see it agree that it is, and a motion that
// turns back at once can have led there. It has to be confirmed anew. One camera of several does
// not count: it may have found something else. (Adjustable level of process noise: Bar-Shalom, Li,
// Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, ch. 11.)
bool HypothesisUpdate::follow_maneuver(const Hypothesis& known, const MeasurementSet& set,
                                       Hypothesis& moved) {
  if (!options_.adapt_motion || (set.measurements.size() < 2 && set.holding > 1)) return false;
  const double seconds = to_seconds(set.time - known.estimate.last_measured);
  const double power = kManeuver * std::pow(std::min(1.0, kManeuverSeconds / seconds), 3);
  if (!(power > 1)) return false;  // the nominal motion has been tried
  std::swap(update_, calm_update_);
  const PoseEstimate anywhere_near = predicted(known, set.time, {power, power}, options_);
  gating_.run(pose_prior(anywhere_near), set.measurements, anywhere_near.world_from_object,
              update_);
  const bool agreed = std::popcount(update_.accepted) > 1 || set.holding == 1;
  if (update_.accepted == 0 || !agreed || update_.inconsistent ||
      2.0 * update_.minimum.prior_cost > nis_limit_) {
    std::swap(update_, calm_update_);
    return false;
  }
  moved.estimate = anywhere_near;
  moved.motion = at_least_nominal(known.motion);
  moved.confirmations = 0;
  return true;
}

// Nobody knows how it goes on from there: a jump over a gap in time, taken for a velocity, would
// lead far away. What the maneuver says of it is believed up to what it was before, or one sigma of
// a start.
void HypothesisUpdate::forget_velocity(const Vector6& before, PoseEstimate& estimate) const {
  const auto limit = [](double most, Eigen::Ref<Eigen::Vector3d> part) {
    if (part.norm() > most) part *= most / part.norm();
  };
  const double angular = options_.start_sigma_angular, linear = options_.start_sigma_linear;
  limit(std::max(angular, before.head<3>().norm()), estimate.twist.head<3>());
  limit(std::max(linear, before.tail<3>().norm()), estimate.twist.tail<3>());
  Vector6 sigma;
  sigma << Eigen::Vector3d::Constant(angular), Eigen::Vector3d::Constant(linear);
  estimate.covariance.topRightCorner<6, 6>().setZero();
  estimate.covariance.bottomLeftCorner<6, 6>().setZero();
  estimate.covariance.bottomRightCorner<6, 6>() = sigma.cwiseAbs2().asDiagonal();
}

// A prediction too loose to point at the right minimum tries the poses that the cameras propose as
// well; each minimum found becomes an outcome and has to be confirmed anew.
void HypothesisUpdate::reacquire(const Hypothesis& predicted, const MeasurementSet& set,
                                 std::vector<Outcome>& outcomes) {
  Hypothesis again = predicted;
  again.confirmations = 0;
  const PosePrior prior = pose_prior(predicted.estimate);
  bool found = false;
  size_t tried = 0;
  for (const CameraMeasurement& measurement : set.measurements) {
    for (const PoseHypothesis& proposed : measurement.observation->hypotheses) {
      if (++tried > kMaxProposals) break;
      gating_.run(prior, set.measurements, proposed.world_from_object, update_);
      if (update_.accepted == 0) continue;
      outcomes.push_back(outcome_of(again, update_, set, symmetric_, options_));
      found = true;
    }
  }
  gating_.run(prior, set.measurements, predicted.estimate.world_from_object, update_);
  if (!found || update_.accepted != 0) {
    outcomes.push_back(outcome_of(again, update_, set, symmetric_, options_));
  }
}

// Motion noise that would have made the innovation an expected one; never above the nominal one (or
// what it is already) in one step.
MotionScale HypothesisUpdate::needed_motion(const GatedUpdate& update,
                                            const MotionScale& motion) const {
  if (!options_.adapt_motion) return motion;
  if (update.inconsistent) return at_least_nominal(motion);
  if (update.accepted == 0) return motion;
  const PoseNis nis = normalized_innovation(update.minimum);
  return nis.pose.squared > kNisAlarm ? raised(nis, motion) : motion;
}

}  // namespace sightline::fuse
