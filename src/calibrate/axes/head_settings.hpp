// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "calibrate/axes/readings.hpp"
#include "sightline/base/result.hpp"
#include "sightline/calibrate/head_sights.hpp"

namespace sightline::calibrate {

/// Where a head stood still, or one image of it in motion. Times [s] since the recording's origin.
struct HeadSetting {
  size_t recording = 0;
  double from_s = 0, to_s = 0;  ///< first and last image
  bool moving = false;
  size_t images = 1;
  std::vector<BodySight> sights;  ///< medians over the images
};

/// One recording, prepared.
struct HeadTimes {
  explicit HeadTimes(const HeadRecording& recording);
  Time origin{};
  Readings readings;
  double tolerance = 0;  ///< readings that differ by less agree [rad]
};

/// A reading comes up to so long after what it says.
inline constexpr double kMostLatency = 0.5;

/// Settings of the head in one recording by what its pictures show: it stands where corners do not
/// move. Refused: angles that stand still while the picture moves.
Result<std::vector<HeadSetting>> head_settings(const HeadSights& sights, size_t recording,
                                               const HeadTimes& times, size_t min_corners);

/// What the readings say of a setting at rest, were they `latency_s` late. Unknown where they do
/// not rest as long as the picture does.
std::optional<Readings::Rest> rest_of(const HeadSetting& setting, const HeadTimes& times,
                                      double latency_s, double slack_s);

/// What the cameras that stand still see of a body while the head looks at it: medians over the
/// images of the settings at rest.
struct FixedSight {
  size_t camera = 0, recording = 0;
  BodySight sight;
};
/// Refused: a body that is not where it was before, from one setting to another.
Result<std::vector<FixedSight>> fixed_sights(const HeadSights& sights,
                                             const std::vector<HeadTimes>& times,
                                             const std::vector<HeadSetting>& settings,
                                             size_t min_corners);

/// Median distance of the corners that two sights have in common [px]; negative if they have fewer
/// than four.
double moved_px(const std::vector<BodySight>& a, const std::vector<BodySight>& b);

}  // namespace sightline::calibrate
