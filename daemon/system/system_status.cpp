// SPDX-License-Identifier: Apache-2.0
#include "system/system_status.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "sightline/base/files.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "web/calibration_json.hpp"
#include "web/head_json.hpp"
#include "web/pose_json.hpp"
#include "web/sight_json.hpp"
#include "web/utc_text.hpp"

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

// What others sent may stand in it, and need not be UTF-8.
std::string text_of(const Json& json, int indent) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}
std::string lines_of(const Json& json) { return text_of(json, 2) + "\n"; }

Json camera_json(const CameraWorker& camera) {
  const CameraStatus status = camera.status();
  const auto& output = camera.output();
  Json json{{"name", camera.name()},
            {"width", camera.width()},
            {"height", camera.height()},
            {"observes", camera.observes()},
            {"streams", output != nullptr},
            {"present", status.present},
            {"frames", status.frames},
            {"frames_lost", status.lost},
            {"rate_hz", std::round(status.rate_hz * 100) / 100},
            {"capture_error_s", status.capture_error_s},
            {"capture_latency_s", status.latency_s},
            {"draw_s", status.draw_s},
            {"not_observed", status.not_observed},
            {"not_drawn", status.not_drawn},
            {"viewers", output ? output->viewers() : 0},
            {"webrtc_viewers", output ? output->browsers() : 0},
            {"picture_viewers", output ? output->pictures().watchers() : 0}};
  if (status.frame_age_s >= 0) json["frame_age_s"] = status.frame_age_s;
  if (output) json["url"] = output->url();
  const std::string encoder = output ? output->encoder_name() : "";
  if (!encoder.empty()) json["encoder"] = encoder;
  if (!status.present) json["no_signal_since"] = utc_text(utc_ns_of(status.lost_since));
  if (!status.problem.empty()) json["problem"] = status.problem;
  return json;
}

Json object_json(const NamedObject& object, const PoseTrackPtr& track,
                 std::span<const std::string> camera_names, const PointCheck* check) {
  Json json{{"name", object.name}};
  if (!track || track->empty()) {
    json["state"] = to_string(TrackState::kSearching);
    return json;
  }
  const PoseEstimate& newest = track->newest();
  add_estimate(newest, camera_names, json);
  if (!has_pose(newest.state)) return json;
  json["age_s"] = to_seconds(MonotonicClock::now() - newest.time);
  if (check != nullptr && check->on_object > 0) {
    json["points"] = {{"on_object", check->on_object},
                      {"rms_mm", check->rms_m * 1e3},
                      {"median_mm", check->median_m * 1e3},
                      {"age_s", to_seconds(newest.time - check->time)},
                      {"contradicts", check->contradicts}};
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

namespace {

Json cell_json(const CellWorker& cell, const std::vector<std::string>& objects) {
  const CellStatus status = cell.status();
  const CellOptions& options = cell.options();
  Json json{{"name", options.name},
            {"host", options.host},
            {"broker", fmt::format("{}:{}", options.broker.host, options.broker.port)},
            {"connected", status.connected},
            {"fusion", status.fusion},
            {"refused", status.refused},
            {"clock_fit", status.clock.fit},
            {"clock_bound_s", to_seconds(status.clock.bound)},
            {"clock", status.clock.text}};
  if (!status.problem.empty()) json["problem"] = status.problem;
  json["hosts"] = Json::array();
  static constexpr const char* kRoles[] = {"both", "cameras", "fusion"};
  for (const CellHostState& host : status.hosts) {
    Json entry{{"host", host.host},
               {"role", kRoles[static_cast<size_t>(host.role)]},
               {"online", host.online},
               {"clock_fit", host.clock_fit},
               {"clock_bound_s", to_seconds(host.clock_bound)},
               {"clock", host.clock},
               {"cameras", Json::array()}};
    if (!host.page.empty()) entry["page"] = host.page;
    for (const CellHostState::Camera& camera : host.cameras) {
      entry["cameras"].push_back(camera.name);
      if (camera.away) entry["cameras_away"].push_back(camera.name);
    }
    json["hosts"].push_back(std::move(entry));
  }
  if (status.neighbors.empty()) return json;
  json["neighbors"] = Json::array();
  for (const CellStatus::Neighbor& neighbor : status.neighbors) {
    json["neighbors"].push_back({{"cell", neighbor.cell}, {"fusion", neighbor.fusion}});
  }
  json["objects"] = Json::array();
  for (size_t i = 0; i < std::min(status.holders.size(), objects.size()); ++i) {
    json["objects"].push_back({{"name", objects[i]}, {"cell", status.holders[i]}});
  }
  return json;
}

Json cameras_array(const System& system) {
  Json cameras = Json::array();
  const auto watches = system.fusion ? system.fusion->calibration() : nullptr;
  const bool watched = watches && system.calibration;
  for (size_t i = 0; i < system.cameras.size(); ++i) {
    cameras.push_back(camera_json(*system.cameras[i]));
    if (const auto& head = system.cameras[i]->head()) add_head(*head, *system.rig, cameras.back());
    if (const auto* angles = system.cameras[i]->angles()) {
      add_angles(angles->status(), cameras.back());
    }
    if (!watched || i >= watches->size() || !system.cameras[i]->observes()) continue;
    add_calibration((*watches)[i], system.installation.cameras[i].calibration.world_from_camera,
                    system.calibration->proposal(), cameras.back());
  }
  return cameras;
}

// By object: the cameras whose heads follow it.
std::vector<Json> followers(const System& system, size_t objects) {
  std::vector<Json> out(objects, Json::array());
  for (const auto& camera : system.cameras) {
    if (!camera->head() || !camera->head()->follows()) continue;
    const auto object = camera->head()->status().object;
    if (object && object->index() < objects) out[object->index()].push_back(camera->name());
  }
  return out;
}

Json objects_array(const System& system) {
  Json objects = Json::array();
  std::vector<std::string> camera_names;
  for (const auto& camera : system.cameras) camera_names.push_back(camera->name());
  for (const RemoteCamera& camera : system.installation.cell.cameras) {
    camera_names.push_back(camera.name);
  }
  std::vector<PoseTrackPtr> tracks;
  if (system.board) system.board->read(tracks);
  const auto zones = system.zones ? system.zones->inside() : nullptr;
  const auto sight = sight_cameras(system);
  const auto local = system.cell ? system.cell->status().local : std::vector<bool>();
  const auto heads = followers(system, tracks.size());
  const auto checks = system.points ? system.points->checks() : std::vector<PointCheck>();
  for (size_t i = 0; i < tracks.size(); ++i) {
    objects.push_back(object_json(system.rig->objects[i].named, tracks[i], camera_names,
                                  i < checks.size() ? &checks[i] : nullptr));
    if (!heads[i].empty()) objects.back()["followed_by"] = heads[i];
    if (i < local.size() && local[i]) objects.back()["local"] = true;
    if (tracks[i] && !tracks[i]->empty()) add_sight(system, *tracks[i], sight, objects.back());
    if (!zones) continue;
    objects.back()["zones"] = i < zones->size() ? (*zones)[i] : std::vector<std::string>();
  }
  return objects;
}

Json views_array(const System& system) {
  Json views = Json::array();
  for (const auto& view : system.views) {
    const StreamOutput& output = *view->output();
    views.push_back({{"name", view->name()},
                     {"width", output.options().width},
                     {"height", output.options().height},
                     {"viewers", output.viewers()},
                     {"webrtc_viewers", output.browsers()},
                     {"picture_viewers", output.pictures().watchers()},
                     {"url", output.url()}});
  }
  return views;
}

bool has_webrtc(const System& system) {
  const auto streams = [](const auto& worker) {
    return worker->output() && worker->output()->has_webrtc();
  };
  return system.installation.http.server.webrtc_viewers > 0 &&
         (std::ranges::any_of(system.cameras, streams) ||
          std::ranges::any_of(system.views, streams));
}

}  // namespace

std::string state_json(const System& system, const ConfigReport& config,
                       const std::vector<ThreadWait>& waits, Layout layout) {
  Json json{{"name", system.installation.name},
            {"utc_ns", utc_now_ns()},
            {"config", config_json(config)},
            {"webrtc", has_webrtc(system)}};
  if (system.recorder && system.recorder->wanted()) {
    json["recording"] = recording_json(system.recorder->status());
  }
  if (system.mqtt) {
    const MqttStatus mqtt = system.mqtt->status();
    json["mqtt"] = {
        {"broker", fmt::format("{}:{}", system.mqtt->options().host, system.mqtt->options().port)},
        {"connected", mqtt.connected}};
    if (!mqtt.problem.empty()) json["mqtt"]["problem"] = mqtt.problem;
  }
  if (system.cell) json["cell"] = cell_json(*system.cell, feed_names(system).objects);
  for (const ThreadWait& wait : waits) json["waiting"].push_back(wait_json(wait));
  json["cameras"] = cameras_array(system);
  json["virtual_cameras"] = views_array(system);
  json["objects"] = objects_array(system);
  return layout == Layout::kLines ? lines_of(json) : text_of(json, -1);
}

std::string cameras_json(const System& system) { return lines_of(cameras_array(system)); }
std::string objects_json(const System& system) { return lines_of(objects_array(system)); }

std::optional<std::string> camera_json(const System& system, const std::string& name) {
  for (const Json& camera : cameras_array(system)) {
    if (camera["name"] == name) return lines_of(camera);
  }
  return std::nullopt;
}

std::optional<std::string> object_json(const System& system, const std::string& name) {
  for (const Json& object : objects_array(system)) {
    if (object["name"] == name) return lines_of(object);
  }
  return std::nullopt;
}

FeedNames feed_names(const System& system) {
  FeedNames names;
  std::vector<CalibratedCamera> calibration;
  for (const CameraConfig& camera : system.installation.cameras) {
    names.cameras.push_back(camera.name);
    calibration.push_back(camera.calibration);
  }
  for (const RemoteCamera& camera : system.installation.cell.cameras) {
    names.cameras.push_back(camera.name);
  }
  if (system.rig) {  // else the system is being started
    for (const RigObject& object : system.rig->objects) names.objects.push_back(object.named.name);
  }
  names.calibration = fmt::format("{:016x}", content_hash(format_calibration(calibration)));
  return names;
}

std::string poses_json(const System& system) {
  std::vector<PoseTrackPtr> tracks;
  if (system.board) system.board->read(tracks);
  const FeedNames names = feed_names(system);
  std::string text = "[";
  for (size_t i = 0; i < tracks.size(); ++i) {
    PoseEstimate estimate;
    if (tracks[i] && !tracks[i]->empty()) {
      estimate = tracks[i]->newest();
    } else {
      estimate.object = ObjectId(static_cast<uint32_t>(i));
      estimate.time = MonotonicClock::now();
    }
    text += (i > 0 ? ",\n " : "") + pose_event_json(estimate, names);
  }
  return text + "]\n";
}

}  // namespace sightline
