// SPDX-License-Identifier: Apache-2.0
#include "web/head_json.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

namespace sightline {
namespace {

// A thousandth of a degree.
double degrees(double angle) { return std::round(angle * 180e3 / std::numbers::pi) / 1e3; }
// A hundredth of a millisecond.
double hundredths(double seconds) { return std::round(seconds * 1e5) / 1e5; }

}  // namespace

void add_head(const AxesWorker& head, const Rig& rig, nlohmann::ordered_json& camera) {
  const Time now = MonotonicClock::now();
  const AxesAt at = head.history()->at(now - from_seconds(head.history()->axes().latency_s));
  nlohmann::ordered_json json{{"angles", to_string(at.state)},
                              {"pan_deg", degrees(at.pan)},
                              {"tilt_deg", degrees(at.tilt)}};
  if (head.follows()) {
    const FollowStatus status = head.status();
    json["mode"] = to_string(status.mode);
    if (status.object && status.object->index() < rig.objects.size()) {
      json["object"] = rig.objects[status.object->index()].named.name;
    }
    json["pan_error_deg"] = degrees(status.error.x());
    json["tilt_error_deg"] = degrees(status.error.y());
    if (status.mode == FollowMode::kHeld || status.mode == FollowMode::kYielding) {
      json["seconds_left"] = std::max(to_seconds(status.until - now), 0.0);
    }
  }
  camera["head"] = std::move(json);
}

void add_angles(const RefinerStatus& status, nlohmann::ordered_json& camera) {
  const char* latency = status.latency_contradicted ? "contradicted"
                        : status.latency_known      ? "known"
                                                    : "unknown";
  nlohmann::ordered_json json{{"picture", to_string(status.verdict)},
                              {"keyframes", status.keyframes},
                              {"latency", latency},
                              {"latency_sigma_s", hundredths(status.latency_sigma_s)}};
  if (status.latency_known) json["latency_s"] = hundredths(status.latency_s);
  if (status.sigma > 0) json["sigma_deg"] = degrees(status.sigma);
  camera["angles_by_picture"] = std::move(json);
}

}  // namespace sightline
