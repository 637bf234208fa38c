// SPDX-License-Identifier: Apache-2.0
#include "state_json.hpp"

#include <cmath>
#include <ctime>
#include <nlohmann/json.hpp>
#include <numbers>

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

std::string utc_text(int64_t utc_ns) {
  const auto seconds = static_cast<time_t>(utc_ns / 1'000'000'000);
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

Json camera_json(const CameraState& camera) {
  Json json{{"name", camera.name},
            {"present", camera.status.present},
            {"frames", camera.status.frames},
            {"frames_lost", camera.status.lost},
            {"rate_hz", std::round(camera.status.rate_hz * 100) / 100},
            {"capture_error_s", camera.status.capture_error_s},
            {"viewers", camera.viewers}};
  if (camera.status.frame_age_s >= 0) json["frame_age_s"] = camera.status.frame_age_s;
  if (!camera.url.empty()) json["url"] = camera.url;
  if (!camera.encoder.empty()) json["encoder"] = camera.encoder;
  if (!camera.status.present)
    json["no_signal_since"] = utc_text(utc_ns_of(camera.status.lost_since));
  if (!camera.status.problem.empty()) json["problem"] = camera.status.problem;
  return json;
}

// Why it is not `tracking`, and where it is weak.
void add_doubts(const PoseEstimate& estimate, Json& json) {
  const auto numbers = [](const Eigen::Vector3d& v) { return Json{v.x(), v.y(), v.z()}; };
  json["reasons"] = Json::array();
  for (int bit = 0; bit < 16; ++bit) {
    const auto one = static_cast<Doubts>(estimate.doubts & (1u << bit));
    if (one != 0) json["reasons"].push_back(to_string(one, ""));
  }
  if (estimate.doubts & kWeakPosition) json["weak_direction"] = numbers(estimate.weak_direction());
  if (estimate.doubts & kWeakRotation) json["weak_axis"] = numbers(estimate.weak_axis());
}

Json object_json(const NamedObject& object, const PoseTrackPtr& track,
                 std::span<const std::string> camera_names, const PointCheck* check) {
  Json json{{"name", object.name}};
  if (!track || track->empty()) {
    json["state"] = to_string(TrackState::kSearching);
    return json;
  }
  const PoseEstimate& newest = track->newest();
  json["state"] = to_string(newest.state);
  if (!has_pose(newest.state)) return json;
  const auto& t = newest.world_from_object.translation;
  const auto& q = newest.world_from_object.rotation;
  json["t_ns"] = to_ns(newest.time);
  json["utc_ns"] = utc_ns_of(newest.time);
  json["translation_m"] = {t.x(), t.y(), t.z()};
  json["rotation_wxyz"] = {q.w(), q.x(), q.y(), q.z()};
  json["sigma_t_mm"] = newest.sigma_translation() * 1e3;
  json["sigma_r_deg"] = newest.sigma_rotation() * 180 / std::numbers::pi;
  if (newest.doubts != 0) add_doubts(newest, json);
  if (check != nullptr && check->on_object > 0) {
    json["points"] = {{"on_object", check->on_object},
                      {"rms_mm", check->rms_m * 1e3},
                      {"median_mm", check->median_m * 1e3},
                      {"age_s", to_seconds(newest.time - check->time)},
                      {"contradicts", check->contradicts}};
  }
  json["cameras"] = Json::array();
  for (size_t i = 0; i < camera_names.size(); ++i) {
    if (newest.cameras & camera_bit(CameraId(static_cast<uint32_t>(i)))) {
      json["cameras"].push_back(camera_names[i]);
    }
  }
  return json;
}

}  // namespace

std::string format_state_json(const std::string& installation, std::span<const CameraState> cameras,
                              std::span<const NamedObject> objects,
                              std::span<const PoseTrackPtr> tracks,
                              std::span<const std::string> camera_names,
                              std::span<const PointCheck> checks) {
  Json json{{"name", installation}, {"cameras", Json::array()}, {"objects", Json::array()}};
  for (const CameraState& camera : cameras) json["cameras"].push_back(camera_json(camera));
  for (size_t i = 0; i < objects.size(); ++i) {
    const PoseTrackPtr track = i < tracks.size() ? tracks[i] : nullptr;
    const PointCheck* check = i < checks.size() ? &checks[i] : nullptr;
    json["objects"].push_back(object_json(objects[i], track, camera_names, check));
  }
  return json.dump(2) + "\n";
}

}  // namespace sightline
