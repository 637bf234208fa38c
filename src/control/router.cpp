// SPDX-License-Identifier: Apache-2.0
#include "control/router.hpp"

#include <algorithm>
#include <array>

#include "control/log_reply.hpp"
#include "sightline/base/log.hpp"
#include "sightline/control/http_server.hpp"

namespace sightline::control {
namespace {

HttpReply missing() { return HttpReply::error(404, "this server has nothing there"); }

HttpReply health_reply(const std::function<Health()>& ask) {
  const Health health = ask ? ask() : Health{true, "ok"};
  return HttpReply::text(health.ok ? 200 : 503, health.text);
}

HttpReply metrics(const HttpContent& content, const Request&, const std::string&) {
  return {200, "text/plain; version=0.0.4; charset=utf-8",
          content.registry ? metrics_text(*content.registry) : std::string()};
}

HttpReply healthz(const HttpContent& content, const Request&, const std::string&) {
  return health_reply(content.health);
}

HttpReply readyz(const HttpContent& content, const Request&, const std::string&) {
  return health_reply(content.ready);
}

HttpReply state(const HttpContent& content, const Request&, const std::string&) {
  return HttpReply::json(content.state_json ? content.state_json() : "{}");
}

template <std::function<std::string()> HttpContent::*kList>
HttpReply list(const HttpContent& content, const Request&, const std::string&) {
  return content.*kList ? HttpReply::json((content.*kList)()) : missing();
}

template <std::function<std::optional<std::string>(const std::string&)> HttpContent::*kOne>
HttpReply one(const HttpContent& content, const Request&, const std::string& name) {
  if (!(content.*kOne)) return missing();
  auto found = (content.*kOne)(name);
  return found ? HttpReply::json(*std::move(found))
               : HttpReply::error(404, "there is nothing of that name");
}

HttpReply asset(const HttpContent&, const Request& request, const std::string&) {
  const auto found = std::ranges::find(assets(), request.path, &Asset::path);
  if (found == assets().end()) return missing();
  return {200, std::string(found->type), std::string(found->bytes)};
}

HttpReply home(const HttpContent& content, const Request& request, const std::string& name) {
  return content.home ? content.home() : asset(content, request, name);
}

HttpReply events(const HttpContent& content, const Request& request, const std::string&) {
  const auto with_state = parse_flag(request.query, "state");
  if (!with_state) return HttpReply::error(with_state.error());
  if (!content.events) return missing();
  HttpReply reply{200, "text/event-stream", ""};
  reply.stream = content.events(*with_state);
  return reply;
}

HttpReply log_lines(const HttpContent&, const Request& request, const std::string&) {
  return log_reply(request.query);
}

template <std::function<Result<HttpReply>(const PictureRequest&)> HttpContent::*kMaker>
HttpReply pictures(const HttpContent& content, const Request& request, const std::string& name) {
  auto wanted = parse_pictures(request.query);
  if (!wanted) return HttpReply::error(wanted.error());
  if (!(content.*kMaker)) return missing();
  if (!name.empty()) {
    if (!wanted->cameras.empty()) return HttpReply::error(400, "the path names the camera");
    wanted->cameras = {name};
  }
  auto made = (content.*kMaker)(*wanted);
  return made ? *std::move(made) : HttpReply::error(made.error());
}

// What somebody changed is in the log, with the name that the token was given to.
HttpReply done(const Request& request, const Status& status, unsigned good) {
  const std::string who = request.user.empty() ? "" : " by " + request.user;
  if (!status) {
    log::info("http: {}{} refused: {}", request.path, who, status.error().message());
    return HttpReply::error(status.error());
  }
  log::info("http: {}{}", request.path, who);
  return {good, "application/json", "{}\n"};
}

HttpReply hint(const HttpContent& content, const Request& request, const std::string& name) {
  if (!content.hint) return missing();
  const auto where = parse_hint(request.body);
  return done(request, where ? content.hint(name, *where) : Status(where.error()), 202);
}

HttpReply forget(const HttpContent& content, const Request& request, const std::string& name) {
  if (!content.forget) return missing();
  const Status empty = parse_nothing(request.body);
  return done(request, empty ? content.forget(name) : empty, 202);
}

HttpReply turn(const HttpContent& content, const Request& request, const std::string& name) {
  if (!content.turn) return missing();
  const auto order = parse_turn(request.body);
  return done(request, order ? content.turn(name, *order) : Status(order.error()), 202);
}

HttpReply follow(const HttpContent& content, const Request& request, const std::string& name) {
  if (!content.follow) return missing();
  const Status empty = parse_nothing(request.body);
  return done(request, empty ? content.follow(name) : empty, 202);
}

HttpReply reload(const HttpContent& content, const Request& request, const std::string&) {
  if (!content.reload) return missing();
  const Status empty = parse_nothing(request.body);
  return done(request, empty ? content.reload() : empty, 202);
}

template <bool kStart>
HttpReply record(const HttpContent& content, const Request& request, const std::string&) {
  const auto& order = kStart ? content.start_recording : content.stop_recording;
  if (!order) return missing();
  const auto wanted = parse_recording_order(request.body, kStart);
  return done(request, wanted ? order(*wanted) : Status(wanted.error()), 202);
}

HttpReply mark(const HttpContent& content, const Request& request, const std::string&) {
  if (!content.mark_recording) return missing();
  const auto text = parse_mark(request.body);
  return done(request, text ? content.mark_recording(*text) : Status(text.error()), 202);
}

// An order whose outcome comes later is in the log then.
HttpReply told(const Request& request, HttpReply reply) {
  if (!reply.later) {
    const bool good = reply.status < 300;
    const std::string who = request.user.empty() ? "" : " by " + request.user;
    log::info("http: {}{}{}", request.path, who,
              good ? "" : " refused: " + reply.body.substr(0, reply.body.find('\n')));
    return reply;
  }
  reply.later = [request, later = std::move(reply.later)]() -> std::optional<HttpReply> {
    auto made = later();
    return made ? std::optional(told(request, *std::move(made))) : std::nullopt;
  };
  return reply;
}

HttpReply set_overlay(const HttpContent& content, const Request& request, const std::string&) {
  if (!content.set_overlay) return missing();
  const auto wanted = parse_overlay(request.body);
  return told(request, wanted ? content.set_overlay(*wanted) : HttpReply::error(wanted.error()));
}

HttpReply reset_overlay(const HttpContent& content, const Request& request, const std::string&) {
  return content.reset_overlay ? told(request, content.reset_overlay()) : missing();
}

HttpReply accept(const HttpContent& content, const Request& request, const std::string&) {
  if (!content.accept_calibration) return missing();
  const auto cameras = parse_cameras(request.body);
  return told(request,
              cameras ? content.accept_calibration(*cameras) : HttpReply::error(cameras.error()));
}

HttpReply start_capture(const HttpContent& content, const Request& request, const std::string&) {
  if (!content.start_capture) return missing();
  const auto order = parse_capture(request.body);
  return told(request, order ? content.start_capture(*order) : HttpReply::error(order.error()));
}

HttpReply stop_capture(const HttpContent& content, const Request& request, const std::string&) {
  if (!content.stop_capture) return missing();
  const Status empty = parse_nothing(request.body);
  return done(request, empty ? content.stop_capture() : empty, 202);
}

template <std::function<HttpReply()> HttpContent::*kMaker>
HttpReply made(const HttpContent& content, const Request&, const std::string&) {
  return content.*kMaker ? (content.*kMaker)() : missing();
}

HttpReply object_mesh(const HttpContent& content, const Request&, const std::string& name) {
  return content.object_mesh ? content.object_mesh(name) : missing();
}

HttpReply recording_file(const HttpContent& content, const Request& request,
                         const std::string& path) {
  if (!content.recording_file) return missing();
  const size_t slash = path.find('/');
  auto made = content.recording_file(path.substr(0, slash), path.substr(slash + 1), request.range);
  return made ? *std::move(made) : HttpReply::error(made.error());
}

HttpReply whep_offer(const HttpContent& content, const Request& request, const std::string& name) {
  if (!content.whep_offer) return missing();
  return content.whep_offer({name, request.body, request.address});
}

HttpReply whep_end(const HttpContent& content, const Request&, const std::string& name) {
  return content.whep_end ? content.whep_end(name) : missing();
}

constexpr auto kView = Role::kViewer;
constexpr auto kOperate = Role::kOperator;
constexpr std::array kRoutes{
    Route{"GET", "/metrics", kView, metrics},
    Route{"GET", "/healthz", Role::kNone, healthz},
    Route{"GET", "/readyz", Role::kNone, readyz},
    Route{"GET", "/api/state", kView, state},
    Route{"GET", "/api/v1/openapi.json", kView, asset},
    Route{"GET", "/api/v1/version", kView, list<&HttpContent::version_json>},
    Route{"GET", "/api/v1/state", kView, state},
    Route{"GET", "/api/v1/cameras", kView, list<&HttpContent::cameras_json>},
    Route{"GET", "/api/v1/cameras/{name}", kView, one<&HttpContent::camera_json>},
    Route{"GET", "/api/v1/objects", kView, list<&HttpContent::objects_json>},
    Route{"GET", "/api/v1/objects/{name}", kView, one<&HttpContent::object_json>},
    Route{"GET", "/api/v1/objects/{name}/mesh", kView, object_mesh},
    Route{"GET", "/api/v1/scene", kView, list<&HttpContent::scene_json>},
    Route{"GET", "/api/v1/scene/mesh", kView, made<&HttpContent::scene_mesh>},
    Route{"GET", "/api/v1/points", kView, list<&HttpContent::points_json>},
    Route{"GET", "/api/v1/overlay", kView, list<&HttpContent::overlay_json>},
    Route{"PUT", "/api/v1/overlay", kOperate, set_overlay},
    Route{"DELETE", "/api/v1/overlay", kOperate, reset_overlay},
    Route{"GET", "/api/v1/calibration", kView, list<&HttpContent::calibration_json>},
    Route{"GET", "/api/v1/calibration/report", kView, made<&HttpContent::calibration_report>},
    Route{"POST", "/api/v1/calibration/accept", kOperate, accept},
    Route{"GET", "/api/v1/calibration/capture", kView, list<&HttpContent::capture_json>},
    Route{"GET", "/api/v1/calibration/capture/targets", kView, made<&HttpContent::capture_targets>},
    Route{"GET", "/api/v1/calibration/capture/report", kView, made<&HttpContent::capture_report>},
    Route{"POST", "/api/v1/calibration/capture/start", kOperate, start_capture},
    Route{"POST", "/api/v1/calibration/capture/stop", kOperate, stop_capture},
    Route{"GET", "/api/v1/poses", kView, list<&HttpContent::poses_json>},
    Route{"GET", "/api/v1/events", kView, events},
    Route{"GET", "/api/v1/log", kView, log_lines},
    Route{"GET", "/api/v1/pictures", kView, pictures<&HttpContent::pictures>},
    Route{"POST", "/api/v1/objects/{name}/hint", kOperate, hint},
    Route{"POST", "/api/v1/objects/{name}/forget", kOperate, forget},
    Route{"POST", "/api/v1/cameras/{name}/turn", kOperate, turn},
    Route{"POST", "/api/v1/cameras/{name}/follow", kOperate, follow},
    Route{"POST", "/api/v1/reload", kOperate, reload},
    Route{"GET", "/api/v1/recordings", kView, list<&HttpContent::recordings_json>},
    Route{"POST", "/api/v1/recordings/start", kOperate, record<true>},
    Route{"POST", "/api/v1/recordings/stop", kOperate, record<false>},
    Route{"POST", "/api/v1/recordings/mark", kOperate, mark},
    Route{"GET", "/api/v1/recordings/{path}", kView, recording_file},
    Route{"GET", "/cameras/{name}/stream.mjpeg", kView, pictures<&HttpContent::motion_jpeg>},
    Route{"GET", "/cameras/{name}/snapshot.jpg", kView, pictures<&HttpContent::snapshot>},
    Route{"POST", "/cameras/{name}/whep", kView, whep_offer, "application/sdp"},
    Route{"DELETE", "/whep/{name}", kView, whep_end},
    Route{"GET", "/", kView, home},
    Route{"GET", "/app.js", kView, asset},
    Route{"GET", "/style.css", kView, asset},
    Route{"GET", "/icon.svg", kView, asset},
};

// The part of the path that stands for "{name}" or "{path}" ("" where there is none); nullopt:
// another path.
std::optional<std::string> match_pattern(std::string_view pattern, std::string_view path) {
  const size_t hole = pattern.find('{');
  if (hole == std::string_view::npos) {
    return pattern == path ? std::optional(std::string()) : std::nullopt;
  }
  const std::string_view before = pattern.substr(0, hole);
  const size_t end = pattern.find('}', hole);
  const std::string_view behind = pattern.substr(end + 1);
  if (path.size() <= before.size() + behind.size() || !path.starts_with(before) ||
      !path.ends_with(behind)) {
    return std::nullopt;
  }
  const auto name = path.substr(before.size(), path.size() - before.size() - behind.size());
  const auto slashes = std::ranges::count(name, '/');
  const bool two = pattern.substr(hole, end - hole + 1) == "{path}";
  if (slashes != (two ? 1 : 0) || name.starts_with('/') || name.ends_with('/')) return std::nullopt;
  return std::string(name);
}

}  // namespace

std::span<const Route> routes() { return kRoutes; }

Match match(std::string_view method, std::string_view path) {
  Match result;
  for (const Route& route : kRoutes) {
    auto name = match_pattern(route.pattern, path);
    if (!name) continue;
    if (!result.allowed.empty()) result.allowed += ", ";
    result.allowed += route.method == "GET" ? "GET, HEAD" : route.method;
    if (route.method != method) continue;
    result.route = &route;
    result.name = *std::move(name);
  }
  return result;
}

}  // namespace sightline::control
