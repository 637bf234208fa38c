// SPDX-License-Identifier: Apache-2.0
#include "web/pose_json.hpp"

#include <numbers>

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

// Why it is not `tracking`, and where it is weak.
void add_reasons(const PoseEstimate& estimate, Json& json) {
  const auto numbers = [](const Eigen::Vector3d& v) { return Json{v.x(), v.y(), v.z()}; };
  json["reasons"] = Json::array();
  for (int bit = 0; bit < 16; ++bit) {
    const auto one = static_cast<DegradedReasons>(estimate.degraded_reasons & (1u << bit));
    if (one != 0) json["reasons"].push_back(to_string(one, ""));
  }
  if (estimate.degraded_reasons & kWeakPosition)
    json["weak_direction"] = numbers(estimate.weak_direction());
  if (estimate.degraded_reasons & kWeakRotation) json["weak_axis"] = numbers(estimate.weak_axis());
}

}  // namespace

void add_estimate(const PoseEstimate& estimate, std::span<const std::string> camera_names,
                  Json& json) {
  json["state"] = to_string(estimate.state);
  if (!has_pose(estimate.state)) return;
  const auto& t = estimate.world_from_object.translation;
  const auto& q = estimate.world_from_object.rotation;
  json["t_ns"] = to_ns(estimate.time);
  json["utc_ns"] = utc_ns_of(estimate.time);
  json["translation_m"] = {t.x(), t.y(), t.z()};
  json["rotation_wxyz"] = {q.w(), q.x(), q.y(), q.z()};
  json["sigma_t_mm"] = estimate.sigma_translation() * 1e3;
  json["sigma_r_deg"] = estimate.sigma_rotation() * 180 / std::numbers::pi;
  if (estimate.degraded_reasons != 0) add_reasons(estimate, json);
  json["cameras"] = Json::array();
  for (size_t i = 0; i < camera_names.size(); ++i) {
    if (estimate.cameras & camera_bit(CameraId(static_cast<uint32_t>(i)))) {
      json["cameras"].push_back(camera_names[i]);
    }
  }
}

std::string pose_event_json(const PoseEstimate& estimate, const FeedNames& names) {
  const size_t index = estimate.object.index();
  Json json{{"object", index < names.objects.size() ? names.objects[index] : ""}};
  json["t_ns"] = to_ns(estimate.time);  // also of states without a pose
  json["utc_ns"] = utc_ns_of(estimate.time);
  json["age_s"] = to_seconds(MonotonicClock::now() - estimate.time);
  json["calibration"] = names.calibration;
  add_estimate(estimate, names.cameras, json);
  if (has_pose(estimate.state)) {
    const Matrix6 covariance = estimate.pose_covariance();
    Json& rows = json["covariance"] = Json::array();
    for (int row = 0; row < 6; ++row) {
      for (int column = 0; column < 6; ++column) rows.push_back(covariance(row, column));
    }
  }
  return json.dump();
}

}  // namespace sightline
