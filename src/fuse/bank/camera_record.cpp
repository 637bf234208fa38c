// SPDX-License-Identifier: Apache-2.0
#include "fuse/bank/camera_record.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "fuse/update/innovation_bias.hpp"

namespace sightline::fuse {
namespace {

constexpr double kPeriodSmoothing = 0.2;
constexpr double kScaleSmoothing = 0.1;
constexpr double kSystematicGain = 0.2;  // of the logarithm, per frame that agrees perfectly
constexpr double kProofGain = 1.0;       // the same of the unproven share
constexpr double kMinUnproven = 1e-5;
constexpr double kSystematicJump = 0.7;  // of the logarithm, at most per frame
constexpr double kEqualization = 0.15;   // of the logarithm, per frame
constexpr double kMaxSystematic = 1000;
// Chance must not look like a systematic error: more than this share above expectation, and the
// memory of better agreement has to be used up first.
constexpr double kSystematicMargin = 1.25;
constexpr double kMinSystematic = 0.4;

void update_period(Time time, CameraRecord& record) {
  const Duration interval = time - record.last_observation;
  if (!record.known || interval <= Duration(0)) return;
  if (record.period == Duration(0)) {
    record.period = interval;
    return;
  }
  // A gap is a dropped frame more often than a slower camera.
  const double gain = interval > record.period * 3 / 2 ? 0.25 * kPeriodSmoothing : kPeriodSmoothing;
  record.period += from_seconds(gain * to_seconds(interval - record.period));
}

// Only what other cameras measured since its own last frame can tell that a camera is off.
bool others_observed(CameraId camera, CameraSet accepted, const EstimatorOptions& options,
                     Time time, const BankState& before) {
  if ((accepted & ~camera_bit(camera)) != 0) return true;
  const CameraRecord& own = before.cameras[camera_slot(camera)];
  for (CameraSet left = before.known & ~camera_bit(camera); left != 0; left &= left - 1) {
    const CameraRecord& other = before.cameras[static_cast<size_t>(std::countr_zero(left))];
    const bool fresh = time - other.last_observation <= hold(other, options);
    if (other.seen && fresh && other.last_observation > own.last_observation) return true;
  }
  return false;
}

// Steps by the score of the variance (its likelihood's slope), so that sets that do not test the
// camera do not train either.
void learn_systematic(const Agreement& agreement, CameraRecord& record) {
  const double step =
      kSystematicGain * (agreement.squared - kSystematicMargin * agreement.expected) / 6.0;
  const double proof =
      kProofGain * (agreement.squared - kSystematicMargin * agreement.expected) / 6.0;
  record.unproven =
      std::clamp(record.unproven * std::exp(std::min(proof, kSystematicJump)), kMinUnproven, 1.0);
  record.systematic = std::clamp(record.systematic * std::exp(std::min(step, kSystematicJump)),
                                 kMinSystematic, kMaxSystematic);
}

// Of two cameras that disagree nobody knows which is wrong, and the one that is trusted less would
// be blamed more and more. So each is drawn to the mean of those that hold the object.
void equalize_systematic(CameraId camera, Time time, const EstimatorOptions& options,
                         BankState& state) {
  double sum = 0;
  int count = 0;
  for (CameraSet left = state.known; left != 0; left &= left - 1) {
    const CameraRecord& other = state.cameras[static_cast<size_t>(std::countr_zero(left))];
    if (!other.seen || time - other.last_observation > hold(other, options)) continue;
    sum += std::log(other.systematic);
    ++count;
  }
  if (count == 0) return;
  CameraRecord& own = state.cameras[camera_slot(camera)];
  own.systematic *= std::exp(kEqualization * (sum / count - std::log(own.systematic)));
}

}  // namespace

Duration hold(const CameraRecord& record, const EstimatorOptions& options) {
  if (record.period == Duration(0)) return options.max_hold;
  return std::min(options.max_hold, from_seconds(options.hold_periods * to_seconds(record.period)));
}

Time held_until(const BankState& state, const EstimatorOptions& options) {
  Time until = Time::min();
  for (CameraSet left = state.known; left != 0; left &= left - 1) {
    const CameraRecord& record = state.cameras[static_cast<size_t>(std::countr_zero(left))];
    if (record.seen) until = std::max(until, record.last_observation + hold(record, options));
  }
  return until;
}

CameraSet holding_cameras(Time time, const EstimatorOptions& options, const BankState& state) {
  CameraSet holding = 0;
  for (CameraSet left = state.known; left != 0; left &= left - 1) {
    const auto index = static_cast<size_t>(std::countr_zero(left));
    const CameraRecord& record = state.cameras[index];
    if (record.seen && time - record.last_observation <= hold(record, options)) {
      holding |= CameraSet{1} << index;
    }
  }
  return holding;
}

int refused_cameras(Time time, const EstimatorOptions& options, const BankState& state) {
  int refused = 0;
  for (CameraSet left = state.known; left != 0; left &= left - 1) {
    const CameraRecord& record = state.cameras[static_cast<size_t>(std::countr_zero(left))];
    refused += record.refused && time - record.last_observation <= hold(record, options) ? 1 : 0;
  }
  return refused;
}

bool record_observations(Time time, std::span<const Observation> set, const Outcome* best,
                         const EstimatorOptions& options, BankState& state) {
  const CameraSet accepted = best != nullptr ? best->accepted : 0;
  const CameraSet gated = best != nullptr ? best->gated : 0;
  bool newly_refused = false;
  if (options.learn_systematic) {
    for (const Observation& observation : set) {
      const CameraId camera = observation.camera;
      if ((accepted & camera_bit(camera)) == 0) continue;
      if (!others_observed(camera, accepted, options, time, state)) continue;
      learn_systematic(best->agreement[camera_slot(camera)], state.cameras[camera_slot(camera)]);
      equalize_systematic(camera, time, options, state);
    }
  }
  for (const Observation& observation : set) {
    const CameraSet bit = camera_bit(observation.camera);
    CameraRecord& record = state.cameras[camera_slot(observation.camera)];
    newly_refused |= (gated & bit) != 0 && !record.refused;
    update_period(time, record);
    record.known = true;
    record.last_observation = time;
    record.seen = (accepted & bit) != 0;
    record.refused = (gated & bit) != 0;
    state.known |= bit;
    if (!record.seen) continue;
    if (options.learn_systematic)
      add_innovation(best->innovations[camera_slot(observation.camera)], record);
    const double cost = best->normalized_cost[camera_slot(observation.camera)];
    record.scale += kScaleSmoothing * (cost - record.scale);
    state.residual += cost / std::popcount(accepted);
  }
  state.residual = std::sqrt(state.residual);
  if (accepted != 0 && options.learn_systematic) {
    state.bias_share = bias_share(holding_cameras(time, options, state), options, state);
  }
  state.gated = gated;
  state.iterations = best != nullptr ? best->iterations : 0;
  return accepted == 0 && newly_refused;
}

}  // namespace sightline::fuse
