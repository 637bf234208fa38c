// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "sightline/base/counters.hpp"
#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"

namespace sightline {

struct HttpOptions {
  std::string address = "127.0.0.1";  ///< numeric IPv4 or IPv6
  uint16_t port = 9754;               ///< 0: any free one, see HttpServer::port()
  /// There is no authentication and no TLS: an address that is not loopback is refused unless set.
  bool allow_remote = false;
  unsigned max_connections = 32;
  Duration timeout = std::chrono::seconds(10);  ///< idle connections are closed
};

struct Health {
  bool ok = true;
  std::string text;  ///< one line for a person
};

/// What the server shows. Called on the server's thread, one request at a time; must not block.
struct HttpContent {
  const Registry* registry = nullptr;       ///< for /metrics; outlives the server
  std::function<Health()> health;           ///< for /healthz; empty: always healthy
  std::function<std::string()> state_json;  ///< for /api/state; empty: "{}"
};

/// Small HTTP/1.1 server: GET (and HEAD) of
///   /metrics    Prometheus text exposition of the registry
///   /healthz    200 or 503 with the health text
///   /api/state  JSON
/// Anything else is 404, other methods 405, request bodies are not read.
/// Runs one thread inside libmicrohttpd, from create() to destruction.
class HttpServer {
 public:
  /// Binds and serves. kInvalidInput for an address that is not allowed, kUnavailable for a busy
  /// port.
  static Result<std::unique_ptr<HttpServer>> create(const HttpOptions& options,
                                                    HttpContent content);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  uint16_t port() const;

 private:
  struct Impl;
  explicit HttpServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Prometheus text exposition format 0.0.4 of all samples.
std::string metrics_text(const Registry& registry);

}  // namespace sightline
