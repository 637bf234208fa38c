// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calibrate/axes/head_inputs.hpp"
#include "sightline/base/result.hpp"

namespace sightline::calibrate {

/// A head whose settings do not fit: refused if two places of a body, one before and one after some
/// setting, explain them.
Status check_moved_bodies(const HeadInputs& inputs, const HeadProblem& problem, bool hold_scales);

}  // namespace sightline::calibrate
