// SPDX-License-Identifier: Apache-2.0
#include "system/system_status.hpp"

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

Json camera_json(const CameraWorker& camera) {
  const CameraStatus status = camera.status();
  const auto& output = camera.output();
  Json json{{"name", camera.name()},
            {"present", status.present},
            {"frames", status.frames},
            {"frames_lost", status.lost},
            {"rate_hz", std::round(status.rate_hz * 100) / 100},
            {"capture_error_s", status.capture_error_s},
            {"viewers", output ? output->viewers() : 0}};
  if (status.frame_age_s >= 0) json["frame_age_s"] = status.frame_age_s;
  if (output) json["url"] = output->url();
  const std::string encoder = output ? output->encoder_name() : "";
  if (!encoder.empty()) json["encoder"] = encoder;
  if (!status.present) json["no_signal_since"] = utc_text(utc_ns_of(status.lost_since));
  if (!status.problem.empty()) json["problem"] = status.problem;
  return json;
}

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
  if (newest.degraded_reasons != 0) add_reasons(newest, json);
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

Json config_json(const ConfigReport& config) {
  Json json{{"file", config.file.string()},
            {"content", config.content},
            {"loaded", utc_text(config.loaded_utc_ns)}};
  if (!config.refused.empty()) {
    json["refused"] = {{"at", utc_text(config.refused_utc_ns)}, {"problem", config.refused}};
  }
  return json;
}

Json recording_json(const RecordingStatus& recording) {
  Json json{{"state", recording.problem.empty() ? "recording" : "stopped"}};
  if (!recording.folder.empty()) json["folder"] = recording.folder.string();
  if (!recording.problem.empty()) json["problem"] = recording.problem;
  return json;
}

Json wait_json(const ThreadWait& wait) {
  return {{"thread", wait.thread}, {"for", wait.what}, {"since", utc_text(utc_ns_of(wait.since))}};
}

std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

std::string cameras_text(const System& system) {
  size_t present = 0;
  std::string absent;
  for (const auto& camera : system.cameras) {
    if (camera->status().present) {
      ++present;
    } else {
      absent += (absent.empty() ? "" : ", ") + camera->name();
    }
  }
  const std::string line = fmt::format("{} of {} cameras", present, system.cameras.size());
  return absent.empty() ? line : line + " (without " + absent + ")";
}

}  // namespace

std::string status_line(const System& system, const ConfigReport& config,
                        const std::vector<ThreadWait>& waits) {
  std::string line = cameras_text(system);
  std::vector<PoseTrackPtr> tracks;
  if (system.board) system.board->read(tracks);
  for (size_t i = 0; i < tracks.size(); ++i) {
    const auto& track = tracks[i];
    const TrackState state =
        track && !track->empty() ? track->newest().state : TrackState::kSearching;
    line += fmt::format("; {}: {}", system.rig->objects[i].named.name, to_string(state));
  }
  const std::string recording = system.recorder ? system.recorder->status().problem : "";
  if (!recording.empty()) line += "; recording stopped: " + first_line(recording);
  for (const ThreadWait& wait : waits) {
    line += fmt::format("; {} waits for {} since {}", wait.thread, wait.what,
                        utc_text(utc_ns_of(wait.since)));
  }
  if (!config.refused.empty()) {
    line += fmt::format("; goes on with {} of {}, the newest was refused: {}", config.file.string(),
                        utc_text(config.loaded_utc_ns), first_line(config.refused));
  }
  return line;
}

std::string state_json(const System& system, const ConfigReport& config,
                       const std::vector<ThreadWait>& waits) {
  Json json{{"name", system.installation.name}, {"config", config_json(config)}};
  if (system.recorder) json["recording"] = recording_json(system.recorder->status());
  for (const ThreadWait& wait : waits) json["waiting"].push_back(wait_json(wait));
  json["cameras"] = Json::array();
  json["objects"] = Json::array();
  std::vector<std::string> camera_names;
  for (const auto& camera : system.cameras) {
    json["cameras"].push_back(camera_json(*camera));
    camera_names.push_back(camera->name());
  }
  std::vector<PoseTrackPtr> tracks;
  if (system.board) system.board->read(tracks);
  const auto checks = system.points ? system.points->checks() : std::vector<PointCheck>();
  for (size_t i = 0; i < tracks.size(); ++i) {
    json["objects"].push_back(object_json(system.rig->objects[i].named, tracks[i], camera_names,
                                          i < checks.size() ? &checks[i] : nullptr));
  }
  return json.dump(2) + "\n";
}

}  // namespace sightline
