// SPDX-License-Identifier: Apache-2.0
#include "fuse/bank/measurement_set.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "fuse/bank/camera_record.hpp"

namespace sightline::fuse {

void collect(Time time, std::span<const Observation> observations, const BankState& state,
             const ShapeSymmetry::Axis* unobservable_axis, const EstimatorOptions& options,
             MeasurementSet& set) {
  set.time = time;
  set.observations = observations;
  set.measurements.clear();
  CameraSet seeing = holding_cameras(time, options, state);
  for (const Observation& observation : observations) {
    if (!observation.terms.empty()) seeing |= camera_bit(observation.camera);
  }
  set.holding = std::popcount(seeing);
  const bool compared = set.holding > 1;
  for (const Observation& observation : observations) {
    if (observation.terms.empty()) continue;
    const CameraRecord& record = state.cameras[camera_slot(observation.camera)];
    CameraMeasurement measurement{
        &observation,     std::max(1.0, record.scale), std::max(1.0, record.systematic), 0, 0,
        unobservable_axis};
    if (compared && options.learn_systematic) {
      measurement.unproven_rotation = record.unproven * std::pow(options.systematic_rotation, 2);
      measurement.unproven_translation =
          record.unproven * std::pow(options.systematic_translation, 2);
    }
    set.measurements.push_back(measurement);
  }
}

}  // namespace sightline::fuse
