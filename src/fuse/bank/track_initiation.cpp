// SPDX-License-Identifier: Apache-2.0
#include "fuse/bank/track_initiation.hpp"

#include <span>

#include "fuse/bank/prediction.hpp"

namespace sightline::fuse {

TrackInitiation::TrackInitiation(const EstimatorOptions& options,
                                 const SymmetricHypotheses& symmetric, ObjectId object)
    : options_(options), symmetric_(symmetric), object_(object), gating_(options) {}

void TrackInitiation::run(const MeasurementSet& set, double evidence, bool challenger,
                          std::vector<Outcome>& outcomes) {
  Hypothesis fresh;
  fresh.evidence = evidence;
  fresh.challenger = challenger;
  PoseEstimate& prior = fresh.estimate;
  prior.object = object_;
  prior.time = set.time;
  prior.covariance.topLeftCorner<6, 6>() = anywhere_covariance();
  Vector6 sigma;
  sigma << Eigen::Vector3d::Constant(options_.start_sigma_angular),
      Eigen::Vector3d::Constant(options_.start_sigma_linear);
  prior.covariance.bottomRightCorner<6, 6>() = sigma.cwiseAbs2().asDiagonal();
  size_t tried = 0;
  for (const CameraMeasurement& measurement : set.measurements) {
    for (const PoseHypothesis& proposed : measurement.observation->hypotheses) {
      if (++tried > kMaxProposals) return;
      prior.world_from_object = proposed.world_from_object;
      start(set, measurement, proposed.world_from_object, fresh, outcomes);
    }
  }
}

// A start is proposed by one camera; the others of the set join if they agree with it within its
// uncertainty. Then one joint update from "anywhere", so that all count in the same way.
void TrackInitiation::start(const MeasurementSet& set, const CameraMeasurement& proposer,
                            const Rigid3& pose, const Hypothesis& fresh,
                            std::vector<Outcome>& outcomes) {
  const PoseEstimate& prior = fresh.estimate;
  gating_.run(pose_prior(prior), std::span(&proposer, 1), pose, update_);
  if (update_.accepted == 0) return;
  double penalty = 0;
  CameraSet gated = 0;
  if (set.measurements.size() > 1) {
    const PoseEstimate proposed = posterior(prior, update_.minimum);
    agreeing_.clear();
    for (const CameraMeasurement& measurement : set.measurements) {
      if (measurement.observation != proposer.observation) agreeing_.push_back(measurement);
    }
    gating_.run(pose_prior(proposed), agreeing_, proposed.world_from_object, update_);
    penalty = update_.penalty;
    gated = update_.gated;
    const Rigid3 joint = update_.accepted != 0 ? update_.minimum.pose : proposed.world_from_object;
    std::erase_if(agreeing_, [&](const CameraMeasurement& measurement) {
      return (update_.accepted & camera_bit(measurement.observation->camera)) == 0;
    });
    agreeing_.push_back(proposer);
    gating_.run(pose_prior(prior), agreeing_, joint, update_);
    if (update_.accepted == 0) return;
  }
  update_.evidence += penalty;
  update_.gated |= gated;
  outcomes.push_back(outcome_of(fresh, update_, set, symmetric_, options_));
  Hypothesis& started = outcomes.back().hypothesis;
  symmetric_.add_evidence(set.observations, started.estimate.world_from_object, started);
  symmetric_.choose(started);
}

}  // namespace sightline::fuse
