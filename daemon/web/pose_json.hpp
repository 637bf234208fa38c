// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "sightline/model/pose_track.hpp"
#include "web/pose_feed.hpp"

namespace sightline {

/// An estimate as the API says it (docs/api.md), after what `json` holds already: "state" and, if
/// there is a pose, times, pose, uncertainty, reasons and cameras.
void add_estimate(const PoseEstimate& estimate, std::span<const std::string> camera_names,
                  nlohmann::ordered_json& json);

/// One "pose" event, on one line: the object's name, its age now, the
/// calibration, the estimate and its covariance.
std::string pose_event_json(const PoseEstimate& estimate, const FeedNames& names);

}  // namespace sightline
