// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "calibrate/axes/head_adjust.hpp"
#include "calibrate/axes/head_inputs.hpp"
#include "sightline/base/result.hpp"

namespace sightline::calibrate {

enum class Outliers {
  kKept,    ///< all count
  kSoft,    ///< Huber's weights beyond 2.5 sigma, by iteration (Holland and Welsch, 1977)
  kLeftOut  ///< corners beyond 6 sigma and settings beyond 5 are left out
};

/// Adjusts, and estimates the noises along, up to `rounds` times or until nothing changes.
/// `least_reading_sigma`: rounding of the readings, which is there in any case [rad].
void fit(HeadProblem& problem, Outliers outliers, int rounds, double least_reading_sigma);

/// Ties a started problem (its base is its world) to the world: by bodies whose place is known, by
/// cameras that stand still and see a body of the head's, or by the first body if that is asked for
/// or the head is the only camera. Says in words which it was.
Result<std::string> tie_to_world(HeadProblem& problem,
                                 const std::vector<CalibratedCamera>& calibration,
                                 bool world_of_target);

/// Root mean square of the distance of corners in the image, settings at rest.
double rest_rms_px(const HeadProblem& problem);

/// Error of each corner of a sight, projection less measurement [px]; angles: read ones and their
/// error. Empty where one does not project.
std::vector<Eigen::Vector2d> corner_errors(const HeadProblem& problem, const HeadView& view,
                                           size_t sight, const Eigen::Vector2d& error);

}  // namespace sightline::calibrate
