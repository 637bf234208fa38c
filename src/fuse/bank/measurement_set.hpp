// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "fuse/bank_state.hpp"
#include "fuse/update/camera_system.hpp"
#include "sightline/fuse/estimator.hpp"

namespace sightline::fuse {

/// The observations of one capture time, weighted by what is known of their cameras.
struct MeasurementSet {
  Time time{};
  std::span<const Observation> observations;
  std::vector<CameraMeasurement> measurements;  ///< of the cameras that see the object
  /// Cameras that see the object now or did in their newest frame.
  int holding = 0;
};

/// Fills `set`, whose memory is reused. `unobservable_axis`: of a round shape, or null.
void collect(Time time, std::span<const Observation> observations, const BankState& state,
             const ShapeSymmetry::Axis* unobservable_axis, const EstimatorOptions& options,
             MeasurementSet& set);

}  // namespace sightline::fuse
