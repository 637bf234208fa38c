// SPDX-License-Identifier: Apache-2.0
#include "web/whep_service.hpp"

#include "sightline/base/log.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

// A session that gets no answer takes longest: several waits inside, each with its bound.
constexpr Duration kStallLimit = 20s;

HttpReply reply_to(const Result<WhepAnswer>& answer) {
  if (!answer) return HttpReply::error(answer.error());
  HttpReply reply{201, "application/sdp", answer->sdp};
  reply.headers = {{"Location", "/whep/" + answer->id}};
  return reply;
}

}  // namespace

std::shared_ptr<WhepService> WhepService::start(bool wanted, HeartbeatBoard& beats,
                                                std::shared_ptr<HttpWaker> waker) {
  std::shared_ptr<WhepService> service(new WhepService(std::move(waker)));
  if (!wanted) return service;
  auto server = WhepServer::create({});
  if (!server) {
    service->problem_ = server.error().text;
    log::info("http: {}; the page shows JPEG pictures", service->problem_);
    return service;
  }
  service->server_ = *std::move(server);
  service->thread_ = start_watched_thread(
      beats, "whep", kStallLimit, [raw = service->server_](std::stop_token stop, Heartbeat& beat) {
        raw->run(std::move(stop), [&beat] { beat.beat(); });
      });
  return service;
}

std::shared_ptr<WhepStream> WhepService::stream(const std::string& camera) {
  return server_ ? server_->stream(camera) : nullptr;
}

void WhepService::keep_only(const std::vector<std::string>& cameras) {
  if (server_) server_->keep_only(cameras);
}

HttpReply WhepService::offer(WhepRequest request, int most) {
  if (!server_) return HttpReply::error(501, problem_);
  if (most == 0) return HttpReply::error(501, "no WebRTC: [http] webrtc_viewers is 0");
  server_->set_max_viewers(most);
  const auto pending =
      server_->offer(request.camera, std::move(request.sdp), std::move(request.address),
                     [waker = waker_] { waker->wake(); });
  if (const auto answer = pending->answer()) return reply_to(*answer);
  HttpReply reply;
  reply.later = [pending]() -> std::optional<HttpReply> {
    const auto answer = pending->answer();
    return answer ? std::optional(reply_to(*answer)) : std::nullopt;
  };
  return reply;
}

HttpReply WhepService::end(const std::string& session) {
  if (!server_ || !server_->end(session)) return HttpReply::error(404, "there is no such session");
  return {200, "application/json", "{}\n"};
}

}  // namespace sightline
