// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>
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
  /// Held at once. At more, those that have owed the rest of their request longest are closed,
  /// first of the address (IPv6: /64 network) with the most. Each takes a descriptor and about 10
  /// kB.
  unsigned max_connections = 512;
  /// From being accepted, or answered before, to the end of the next answer; then it is closed,
  /// whatever trickles in meanwhile.
  Duration deadline = std::chrono::seconds(10);

  bool operator==(const HttpOptions&) const = default;
};

struct Health {
  bool ok = true;
  std::string text;  ///< one line for a person
};

/// What the server shows. Called on the thread of HttpServer::run(), one request at a time; must
/// not block.
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
/// Passive: it serves in the thread that calls run().
class HttpServer {
 public:
  /// Binds; who connects waits for run(). kInvalidInput for an address that is not allowed,
  /// kUnavailable for a busy port.
  static Result<std::unique_ptr<HttpServer>> create(const HttpOptions& options,
                                                    HttpContent content);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// Serves until `stop`; one thread, once. The server outlives it.
  void run(std::stop_token stop);
  uint16_t port() const;

 private:
  struct Impl;
  explicit HttpServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Prometheus text exposition format 0.0.4 of all samples.
std::string metrics_text(const Registry& registry);

}  // namespace sightline
