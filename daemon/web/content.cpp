// SPDX-License-Identifier: Apache-2.0
#include "web/content.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "system/system_status.hpp"
#include "version.hpp"
#include "web/calibration_json.hpp"
#include "web/capture_json.hpp"
#include "web/picture_streams.hpp"
#include "web/scene_json.hpp"

namespace sightline {
namespace {

std::string version_json() {
  return nlohmann::ordered_json{{"program", "sightlined"}, {"version", kVersion}, {"api", 1}}.dump(
             2) +
         "\n";
}

// Ready is who has pictures to look at: it may take a moment after the start.
Health readiness(const WebSources& sources) {
  Health health = sources.health();
  if (!health.ok) return health;
  const auto system = sources.system();
  const bool any =
      std::ranges::any_of(system->cameras, [](const auto& camera) { return camera->present(); });
  if (any) return health;
  return {false, "no camera sends frames"};
}

Result<SearchHint> search_hint(const System& system, const HintRequest& request) {
  if (const auto* pose = std::get_if<Rigid3>(&request.where)) return SearchHint(*pose);
  const auto& place = std::get<HintRequest::Place>(request.where);
  for (size_t i = 0; i < system.cameras.size(); ++i) {
    const CameraWorker& camera = *system.cameras[i];
    if (camera.name() != place.camera) continue;
    const bool inside = place.pixel.x() >= -0.5 && place.pixel.x() <= camera.width() - 0.5 &&
                        place.pixel.y() >= -0.5 && place.pixel.y() <= camera.height() - 0.5;
    if (!inside) {
      return make_error(ErrorCode::kInvalidInput, place.camera,
                        "x and y lie outside its image of {}x{} pixels", camera.width(),
                        camera.height());
    }
    ImageHint hint;
    hint.camera = CameraId(static_cast<uint32_t>(i));
    hint.pixel = place.pixel;
    hint.radius_px = place.radius_px.value_or(ImageHint::kRadiusPx);
    return SearchHint(hint);
  }
  return make_error(ErrorCode::kNotFound, place.camera, "there is no such camera");
}

Result<std::shared_ptr<AxesWorker>> head_of(const System& system, const std::string& camera) {
  for (const auto& worker : system.cameras) {
    if (worker->name() != camera) continue;
    if (worker->head()) return worker->head();
    return make_error(ErrorCode::kInvalidInput, camera, "stands still, or is recorded");
  }
  return make_error(ErrorCode::kNotFound, camera, "there is no such camera");
}

Status known_object(const System& system, const std::string& name) {
  const auto& objects = system.installation.objects;
  const bool known = std::ranges::any_of(
      objects, [&](const ObjectConfig& object) { return object.description.name == name; });
  if (known) return {};
  return make_error(ErrorCode::kNotFound, name, "there is no such object");
}

Result<std::shared_ptr<PictureSlot>> picture_slot(const WebSources& sources,
                                                  const std::string& camera, PictureKind kind) {
  const auto system = sources.system();
  const auto has_output = [&](const auto& worker) {
    return worker->name() == camera && worker->output();
  };
  const bool is_camera = std::ranges::any_of(system->cameras, has_output);
  const bool is_view = std::ranges::any_of(system->views, has_output);
  const auto slot = is_camera || is_view ? sources.pictures->find(camera) : nullptr;
  if (!slot) {
    return make_error(ErrorCode::kNotFound, camera, "there is no camera of that name that streams");
  }
  if (is_view && kind == PictureKind::kClean) {
    return make_error(ErrorCode::kInvalidInput, camera,
                      "a virtual camera has no picture without annotation");
  }
  return slot;
}

PictureKind kind_of(const PictureRequest& request) {
  return request.annotated ? PictureKind::kAnnotated : PictureKind::kClean;
}

Result<HttpReply> pictures(const WebSources& sources, PictureRequest request) {
  if (request.cameras.empty()) {
    const auto system = sources.system();
    for (const auto& camera : system->cameras) {
      if (camera->output()) request.cameras.push_back(camera->name());
    }
    for (const auto& view : system->views) {
      if (request.annotated) request.cameras.push_back(view->name());
    }
  }
  std::vector<std::shared_ptr<PictureSlot>> slots;
  for (const std::string& camera : request.cameras) {
    SL_ASSIGN(auto slot, picture_slot(sources, camera, kind_of(request)));
    slots.push_back(std::move(slot));
  }
  if (slots.empty()) {
    return make_error(ErrorCode::kNotFound, "", "no camera of this installation streams");
  }
  return pictures_reply(slots, kind_of(request), request.max_rate_hz);
}

void add_lists(const WebSources& s, HttpContent& content) {
  content.version_json = version_json;
  content.state_json = [s] { return state_json(*s.system(), *s.config(), s.waits()); };
  content.cameras_json = [s] { return cameras_json(*s.system()); };
  content.objects_json = [s] { return objects_json(*s.system()); };
  content.poses_json = [s] { return poses_json(*s.system()); };
  content.scene_json = [s] { return scene_json(*s.system()); };
  content.points_json = [s] { return points_json(*s.system()); };
  content.calibration_json = [s] { return calibration_json(*s.system(), *s.config()); };
  content.capture_json = [s] { return capture_json(*s.captures->shown()); };
  content.object_mesh = [s](const std::string& name) {
    return object_mesh_reply(*s.system(), name);
  };
  content.camera_json = [s](const std::string& name) { return camera_json(*s.system(), name); };
  content.object_json = [s](const std::string& name) { return object_json(*s.system(), name); };
}

void add_orders(const WebSources& s, HttpContent& content) {
  content.hint = [s](const std::string& object, const HintRequest& request) -> Status {
    const auto system = s.system();
    SL_RETURN_IF_ERROR(known_object(*system, object));
    SL_ASSIGN(const SearchHint hint, search_hint(*system, request));
    return system->hint(object, hint);
  };
  content.forget = [s](const std::string& object) -> Status {
    const auto system = s.system();
    SL_RETURN_IF_ERROR(known_object(*system, object));
    return system->forget(object);
  };
  content.turn = [s](const std::string& camera, const TurnOrder& order) -> Status {
    SL_ASSIGN(const auto head, head_of(*s.system(), camera));
    const Duration time = order.seconds ? from_seconds(*order.seconds) : head->config().yield;
    return head->hold(order.pan_tilt, time);
  };
  content.follow = [s](const std::string& camera) -> Status {
    SL_ASSIGN(const auto head, head_of(*s.system(), camera));
    return head->release();
  };
  content.stop_capture = [s] { return s.captures->conclude(); };
  if (s.request_reload) {
    content.reload = [s]() -> Status {
      s.request_reload();
      return {};
    };
  }
}

void add_streams(const WebSources& s, HttpContent& content) {
  content.events = [s](bool with_state) {
    std::function<std::string()> state;
    if (with_state) {
      state = [s] { return state_json(*s.system(), *s.config(), s.waits(), Layout::kOneLine); };
    }
    return make_event_stream(s.poses, std::move(state));
  };
  content.pictures = [s](const PictureRequest& request) { return pictures(s, request); };
  content.motion_jpeg = [s](const PictureRequest& request) -> Result<HttpReply> {
    SL_ASSIGN(auto slot, picture_slot(s, request.cameras.at(0), kind_of(request)));
    return motion_jpeg_reply(std::move(slot), kind_of(request), request.max_rate_hz);
  };
  content.whep_offer = [s](WhepRequest request) {
    return s.whep->offer(std::move(request), s.system()->installation.http.server.webrtc_viewers);
  };
  content.whep_end = [s](const std::string& session) { return s.whep->end(session); };
  content.snapshot = [s](const PictureRequest& request) -> Result<HttpReply> {
    SL_ASSIGN(auto slot, picture_slot(s, request.cameras.at(0), kind_of(request)));
    return snapshot_reply(std::move(slot), kind_of(request));
  };
}

void add_recordings(const std::shared_ptr<RecordingManager>& manager, HttpContent& content) {
  content.recordings_json = [manager] { return manager->json(); };
  content.start_recording = [manager](const RecordingOrder& order) {
    return manager->begin(order);
  };
  content.stop_recording = [manager](const RecordingOrder& order) { return manager->end(order); };
  content.mark_recording = [manager](const std::string& text) { return manager->mark(text); };
  content.recording_file = [manager](const std::string& name, const std::string& file,
                                     const std::string& range) {
    return manager->file(name, file, range);
  };
}

}  // namespace

HttpContent web_content(WebSources sources) {
  HttpContent content;
  content.registry = sources.registry;
  content.health = sources.health;
  content.ready = [sources] { return readiness(sources); };
  content.waker = sources.waker;
  add_lists(sources, content);
  add_orders(sources, content);
  add_streams(sources, content);
  add_recordings(sources.recordings, content);
  return content;
}

}  // namespace sightline
