// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <thread>

#include "heartbeat.hpp"
#include "sightline/control/http_server.hpp"
#include "sightline/stream/rtsp_server.hpp"

namespace sightline {

/// The RTSP server and the thread ("rtsp") that it runs on, with a heartbeat.
class RtspService {
 public:
  static Result<std::shared_ptr<RtspService>> start(const RtspOptions& options,
                                                    HeartbeatBoard& beats);
  ~RtspService() { stop(); }
  /// Gives the port back; viewers are dropped.
  void stop();
  /// Takes the port again after stop(); streams have to be added again.
  Status resume();

  const RtspOptions& options() const { return options_; }
  /// Not after stop().
  RtspServer& server() { return *server_; }

 private:
  RtspService(RtspOptions options, HeartbeatBoard& beats)
      : options_(std::move(options)), beats_(beats) {}

  const RtspOptions options_;
  HeartbeatBoard& beats_;
  std::unique_ptr<RtspServer> server_;
  std::jthread thread_;
};

/// The HTTP server and the thread ("http") that it runs on. It must not be stopped on that thread:
/// whoever asks it holds what it answers from, perhaps as the last.
class HttpService {
 public:
  static Result<std::shared_ptr<HttpService>> start(const HttpOptions& options,
                                                    HttpContent content);
  ~HttpService() { stop(); }
  /// Gives the port back; from any thread but the server's own.
  void stop();
  /// Takes the port again after stop().
  Status resume();

  const HttpOptions& options() const { return options_; }
  uint16_t port() const { return port_; }

 private:
  HttpService(HttpOptions options, HttpContent content)
      : options_(std::move(options)), content_(std::move(content)) {}

  const HttpOptions options_;
  const HttpContent content_;
  std::unique_ptr<HttpServer> server_;
  std::atomic<uint16_t> port_{0};
  std::jthread thread_;
};

}  // namespace sightline
