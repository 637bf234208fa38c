// SPDX-License-Identifier: Apache-2.0
// Whole requests, from the path to the answer: "METHOD PATH?QUERY", a line break, the body.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "control/router.hpp"
#include "sightline/base/check.hpp"
#include "sightline/base/log.hpp"

namespace {

using namespace sightline;
using namespace sightline::control;

// Takes everything, so that nothing but the request decides.
HttpContent content() {
  const auto json = [] { return std::string("{}"); };
  const auto named = [](const std::string&) { return std::optional<std::string>("{}"); };
  const auto reply = [] { return HttpReply::json("{}"); };
  const auto pictures = [](const PictureRequest& request) -> Result<HttpReply> {
    SL_CHECK(request.max_rate_hz == 0 || (request.max_rate_hz >= 0.1 && request.max_rate_hz <= 240),
             "a rate");
    return HttpReply::json("{}");
  };
  HttpContent c;
  c.state_json = c.version_json = c.cameras_json = c.objects_json = c.poses_json = json;
  c.overlay_json = c.scene_json = c.points_json = c.calibration_json = c.recordings_json = json;
  c.camera_json = c.object_json = named;
  c.hint = [](const std::string&, const HintRequest&) { return Status(); };
  c.forget = [](const std::string&) { return Status(); };
  c.turn = [](const std::string&, const TurnOrder& order) {
    SL_CHECK(!order.pan_tilt || order.pan_tilt->cwiseAbs().maxCoeff() < 6.3, "within a turn");
    return Status();
  };
  c.follow = [](const std::string&) { return Status(); };
  c.reload = [] { return Status(); };
  c.set_overlay = [](const OverlayRequest& request) {
    SL_CHECK(!request.keys.empty() && request.keys.ends_with('\n'), "lines of TOML");
    return HttpReply::json("{}");
  };
  c.reset_overlay = c.scene_mesh = c.calibration_report = reply;
  c.object_mesh = [](const std::string&) { return HttpReply::json("{}"); };
  c.accept_calibration = [](const std::vector<std::string>&) { return HttpReply::json("{}"); };
  c.start_recording = c.stop_recording = [](const RecordingOrder& order) {
    SL_CHECK(!order.seconds || (*order.seconds >= 1 && *order.seconds <= 86400), "a time");
    return Status();
  };
  c.mark_recording = [](const std::string& text) {
    SL_CHECK(text.size() <= 1000, "a mark");
    return Status();
  };
  c.recording_file = [](const std::string& name, const std::string& file,
                        const std::string&) -> Result<HttpReply> {
    SL_CHECK(!name.empty() && name.find('/') == std::string::npos, "a name");
    SL_CHECK(!file.empty() && file.find('/') == std::string::npos, "a file");
    return HttpReply::json("{}");
  };
  c.pictures = c.motion_jpeg = c.snapshot = pictures;
  c.whep_offer = [](const WhepRequest&) { return HttpReply::json("{}"); };
  c.whep_end = [](const std::string&) { return HttpReply::json("{}"); };
  return c;
}

Query query_of(std::string_view text) {
  Query query;
  while (!text.empty()) {
    const auto pair = text.substr(0, text.find('&'));
    const auto key = pair.substr(0, pair.find('='));
    query.emplace(key, pair.size() > key.size() ? pair.substr(key.size() + 1) : "");
    text.remove_prefix(std::min(text.size(), pair.size() + 1));
  }
  return query;
}

Request request_of(std::string_view target, std::string_view body) {
  Request request;
  const size_t question = std::min(target.find('?'), target.size());
  request.path = target.substr(0, question);
  request.query = query_of(target.substr(std::min(question + 1, target.size())));
  request.body = body;
  return request;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const HttpContent all = [] {
    log::set_level(log::Level::kError);
    return content();
  }();
  std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto line = text.substr(0, text.find('\n'));
  const auto body = text.size() > line.size() ? text.substr(line.size() + 1) : std::string_view();
  const auto method = line.substr(0, line.find(' '));
  const auto target =
      line.size() > method.size() ? line.substr(method.size() + 1) : std::string_view();
  const Request request = request_of(target, body);
  const Match found = match(method, request.path);
  if (found.route == nullptr) return 0;
  SL_CHECK(found.route->method == method, "of that method");
  const HttpReply reply = found.route->answer(all, request, found.name);
  SL_CHECK(reply.status >= 200 && reply.status < 600, "a status");
  if (reply.status < 400) return 0;
  const auto json = nlohmann::json::parse(reply.body, nullptr, false);
  SL_CHECK(json.is_object() && json["error"].is_string(), "an error says why, in UTF-8");
  return 0;
}
