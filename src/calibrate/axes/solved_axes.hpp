// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calibrate/axes/head_adjust.hpp"
#include "calibrate/axes/head_inputs.hpp"

namespace sightline::calibrate {

/// Why something was held, for the report; empty: it was solved for.
struct HeldWords {
  std::string scales, pan_play, tilt_play, latency, lens;
};

/// What a fitted problem comes to, without held-out errors. `prior`: the camera as it was in the
/// calibration. Refused: what is not determined.
Result<AxesSolution> solution_of(const HeadInputs& inputs, const HeadProblem& problem,
                                 const CalibratedCamera& prior, const HeldWords& held);

/// Predicts each setting at rest by a fit to three quarters of the others, by its reading alone.
void add_held_out(const HeadProblem& problem, AxesSolution& solution);

}  // namespace sightline::calibrate
