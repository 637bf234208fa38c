// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "sightline/base/counters.hpp"
#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/control/access.hpp"
#include "sightline/control/http_content.hpp"

namespace sightline {

struct HttpOptions {
  std::string address = "127.0.0.1";  ///< numeric IPv4 or IPv6
  uint16_t port = 9754;               ///< 0: any free one, see HttpServer::port()
  /// Who may come (read_tokens()). Empty: everybody who reaches the address is an operator.
  std::filesystem::path tokens;
  uint64_t tokens_content = 0;  ///< hash of that file, so that new tokens are a difference
  TlsFiles tls;                 ///< none: HTTP without TLS
  /// An address that is not loopback is refused without tokens, unless this says that everybody is
  /// meant. With tokens: who brings none is a viewer.
  bool open = false;
  /// Host names that a browser may call this server by, beside numeric addresses, localhost and
  /// the machine's own name. Others are refused: a page of another site may have been talked into
  /// them (DNS rebinding).
  std::vector<std::string> names;
  /// Held at once. At more, those that have owed the rest of their request longest are closed,
  /// first of the address (IPv6: /64 network) with the most. Each takes a descriptor and about 10
  /// kB.
  unsigned max_connections = 512;
  /// Of these, answers without an end (events, pictures); more are refused with 503.
  unsigned max_streams = 64;
  /// Viewers by WebRTC at once; 0: none. The daemon's to use.
  int webrtc_viewers = 32;
  /// From being accepted, or answered before, to the end of the next answer; then it is closed,
  /// whatever trickles in meanwhile. A stream whose reader takes nothing for so long, too.
  Duration deadline = std::chrono::seconds(10);

  bool operator==(const HttpOptions&) const = default;
};

/// HTTP/1.1 server of the API, the metrics and the page (docs/api.md). Each request is judged
/// before it is answered: Host, Origin, method, token and role, size. Bodies of at most 64 KiB are
/// taken by POST alone. Passive: it serves in the thread that calls run().
class HttpServer {
 public:
  /// Binds; who connects waits for run(). kInvalidInput for an address that is not allowed, or for
  /// what is wrong with the tokens; kUnavailable for a busy port.
  static Result<std::unique_ptr<HttpServer>> create(const HttpOptions& options,
                                                    HttpContent content);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// Serves until `stop`; one thread, once. The server outlives it.
  void run(std::stop_token stop);
  uint16_t port() const;

  static constexpr size_t kMostBody = 64 << 10;  ///< [bytes] of a request

 private:
  struct Impl;
  explicit HttpServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Prometheus text exposition format 0.0.4 of all samples.
std::string metrics_text(const Registry& registry);

}  // namespace sightline
