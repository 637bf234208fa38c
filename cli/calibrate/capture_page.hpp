// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "calibration/capture_session.hpp"
#include "sightline/base/time.hpp"
#include "sightline/control/http_server.hpp"

namespace sightline {
class HttpService;
}

namespace sightline::cli {

/// What a capture is at, as a page for the phone of who holds the target: the same words as on the
/// terminal, what has been taken, and a coverage picture for each camera. Served by the daemon's
/// HTTP server, under the same rules of who may see it. Any thread may call.
class CapturePage {
 public:
  /// Refused: an address that others reach without what the installation has to say of that, a
  /// busy port.
  static Result<std::unique_ptr<CapturePage>> start(const HttpOptions& options,
                                                    std::vector<std::string> cameras);
  ~CapturePage();

  /// "http://127.0.0.1:8080/"
  const std::string& address() const { return address_; }
  /// Takes over what has changed.
  void show(const CaptureSession& session, const CaptureState& state);
  /// The capture is over, and this came of it. Waits until who looks at the page has been told, a
  /// few seconds at most.
  void finish(const std::string& words, bool good);

 private:
  struct Shared;
  CapturePage(std::vector<std::string> cameras, std::shared_ptr<Shared> shared);

  const std::vector<std::string> cameras_;
  const std::shared_ptr<Shared> shared_;  // with the server's thread
  std::string address_, pictures_, seen_;
  size_t drawn_sets_ = SIZE_MAX;
  std::shared_ptr<HttpService> service_;
};

}  // namespace sightline::cli
