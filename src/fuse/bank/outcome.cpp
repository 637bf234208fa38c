// SPDX-License-Identifier: Apache-2.0
#include "fuse/bank/outcome.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <bit>

#include "fuse/update/innovation_bias.hpp"
#include "fuse/update/motion_scale.hpp"

namespace sightline::fuse {
namespace {

constexpr double kNoSystematic = 1e-14;  // [rad^2, m^2]

// A running sum over the cameras that hold the object: each set counts for its own cameras and
// takes the place of their share of the sum.
void add_systematic(const GatedUpdate& update, int holding, Matrix6& information) {
  const double fresh = static_cast<double>(update.accepted_measurements.size());
  information *= std::max(0.0, 1.0 - fresh / std::max(1, holding));
  for (size_t i = 0; i < update.accepted_measurements.size(); ++i) {
    // R' = s R + V is what the update took for white; s R + V - R of it is not.
    const CameraMeasurement& measurement = update.accepted_measurements[i];
    Matrix6 known = update.minimum.systems[i].information;
    known.diagonal() += anywhere_covariance().diagonal().cwiseInverse();
    Matrix6 part = (1.0 - 1.0 / measurement.systematic) * known.ldlt().solve(Matrix6::Identity());
    part.diagonal().head<3>().array() += measurement.unproven_rotation / measurement.systematic;
    part.diagonal().tail<3>().array() += measurement.unproven_translation / measurement.systematic;
    part.diagonal().array() += kNoSystematic;
    information += part.ldlt().solve(Matrix6::Identity());
  }
}

double largest_systematic(const GatedUpdate& update) {
  double systematic = 1.0;
  for (const CameraMeasurement& measurement : update.accepted_measurements) {
    systematic = std::max(systematic, measurement.systematic);
  }
  return systematic;
}

}  // namespace

Outcome outcome_of(const Hypothesis& predicted, const GatedUpdate& update,
                   const MeasurementSet& set, const SymmetricHypotheses& symmetric,
                   const EstimatorOptions& options) {
  Outcome outcome;
  outcome.hypothesis = predicted;
  outcome.hypothesis.evidence += update.evidence;
  outcome.accepted = update.accepted;
  outcome.gated = update.gated;
  outcome.iterations = update.minimum.iterations;
  outcome.normalized_cost = update.normalized_cost;
  outcome.agreement = update.agreement;
  if (update.accepted == 0) return outcome;
  Hypothesis& h = outcome.hypothesis;
  h.estimate = posterior(predicted.estimate, update.minimum);
  symmetric.bound_unobservable_axis(h.estimate);
  h.estimate.cameras = update.accepted;
  h.estimate.last_measured = set.time;
  h.confirmations = predicted.confirmations + std::popcount(update.accepted);
  if (options.adapt_motion) {
    learn(set.time, update.minimum, set.holding, largest_systematic(update), h.corrections,
          h.motion);
    symmetric.bound_motion(h.motion);
  }
  add_systematic(update, set.holding, h.systematic_information);
  for (size_t i = 0; options.learn_systematic && i < update.accepted_measurements.size(); ++i) {
    const CameraId camera = update.accepted_measurements[i].observation->camera;
    outcome.innovations[camera_slot(camera)] = innovation_of(update.minimum, i);
  }
  return outcome;
}

}  // namespace sightline::fuse
