// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "observe/track/model_tracker.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline::observe {

/// Motion that turns back at once is not where it was predicted. Where else to look for an object
/// that moved: at its newest pose, as far around as its velocity has led since. `newest`: the last
/// estimate of its track, `time`: of the frame, `radius`: of the object [m]. Nothing if it hardly
/// moved, or if that was so long ago that the prediction covers it.
std::optional<Prediction> where_it_was(const PoseEstimate& newest, Time time, double radius,
                                       bool ambiguous);

/// Whether what was measured leaves it open that the object is somewhere else: it was not seen, or
/// it is not where it was predicted.
bool calls_for_second_look(const Prediction& prediction,
                           const ModelTracker::Measurement& measurement);

/// How well the image shows the object where it was measured, 0 .. 1: evidence of the lines that
/// agree, those that do not counting as none.
double agreement(const ObjectTracker::TrackResult& result);

}  // namespace sightline::observe
