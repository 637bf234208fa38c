// SPDX-License-Identifier: Apache-2.0
#include "system/servers.hpp"

#include "sightline/base/thread.hpp"
#include "sightline/control/access.hpp"

namespace sightline {
namespace {

constexpr Duration kStallLimit = std::chrono::seconds(10);  // ending a stream takes its time

}  // namespace

Result<std::shared_ptr<RtspService>> RtspService::start(const RtspOptions& options,
                                                        HeartbeatBoard& beats) {
  std::shared_ptr<RtspService> service(new RtspService(options, beats));
  SL_RETURN_IF_ERROR(service->resume());
  return service;
}

Status RtspService::resume() {
  RtspOptions options = options_;
  if (!options.tokens.empty()) {
    SL_ASSIGN(const auto tokens, read_tokens(options.tokens));
    for (const AccessToken& token : tokens) options.users.push_back({token.name, token.secret});
  }
  if (!options.certificate.empty()) {
    SL_ASSIGN(TlsTexts tls, read_tls({options.certificate, options.key, 0}));
    options.certificate_pem = std::move(tls.certificate);
    options.key_pem = std::move(tls.key);
  }
  SL_ASSIGN(server_, RtspServer::create(options));
  thread_ = start_watched_thread(beats_, "rtsp", kStallLimit,
                                 [raw = server_.get()](std::stop_token stop, Heartbeat& beat) {
                                   raw->run(std::move(stop), [&beat] { beat.beat(); });
                                 });
  return {};
}

void RtspService::stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
  server_.reset();
}

Result<std::shared_ptr<HttpService>> HttpService::start(const HttpOptions& options,
                                                        HttpContent content) {
  std::shared_ptr<HttpService> service(new HttpService(options, std::move(content)));
  SL_RETURN_IF_ERROR(service->resume());
  return service;
}

Status HttpService::resume() {
  SL_ASSIGN(server_, HttpServer::create(options_, content_));
  port_ = server_->port();
  thread_ = start_thread("http", [raw = server_.get()](std::stop_token stop) { raw->run(stop); });
  return {};
}

void HttpService::stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
  server_.reset();
}

}  // namespace sightline
