// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <vector>

#include "calibrate/axes/head_problem.hpp"
#include "sightline/base/result.hpp"

namespace sightline::calibrate {

/// What a problem is made of; its views point into it.
struct HeadInputs {
  HeadSights sights;
  std::vector<HeadTimes> times;  ///< by recording
  std::vector<HeadSetting> settings;
  std::vector<FixedSight> fixed;
  std::vector<double> zooms;  ///< values at which there are settings, growing; one: it stands
  double step = 0;            ///< of the readings, smallest over the recordings [rad]
};

/// "camera head", for the place of an error.
std::string head_place(const HeadSights& sights);

/// Refuses what no solver can use: no readings, angles that never change, numbers that are not
/// finite, cameras that are not in the calibration or of another image size.
Status check_sights(const HeadSights& sights, const std::vector<CalibratedCamera>& calibration);

/// Settings of all recordings. Refused: angles that are frozen, bodies that were moved before a
/// camera that stands still, too few settings, an axis that was not turned, a zoom that changes (or
/// does not) against what was asked for.
Result<HeadInputs> gather_inputs(const HeadSights& sights, const AxesOptions& options);

/// Views of those settings, were the readings so late: at rest those whose readings rest, in motion
/// those whose readings turn.
std::vector<HeadView> make_views(const HeadInputs& inputs, double latency_s, double slack_s);

/// Index of the value of the zoom that a reading belongs to; SIZE_MAX: none.
size_t zoom_index(const std::vector<double>& zooms, double zoom);

}  // namespace sightline::calibrate
