// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "heartbeat.hpp"
#include "sightline/control/http_content.hpp"
#include "sightline/stream/whep.hpp"

namespace sightline {

/// WebRTC for browsers and the thread ("whep") that it runs on; where this machine or build has
/// none, the reason. Any thread; never waits.
class WhepService {
 public:
  /// With `wanted` false there is none.
  static std::shared_ptr<WhepService> start(bool wanted, HeartbeatBoard& beats,
                                            std::shared_ptr<HttpWaker> waker);

  bool available() const { return server_ != nullptr; }
  /// Null without WebRTC.
  std::shared_ptr<WhepStream> stream(const std::string& camera);
  void keep_only(const std::vector<std::string>& cameras);
  /// The answer to an offer, later; at most `most` viewers in all.
  HttpReply offer(WhepRequest request, int most);
  HttpReply end(const std::string& session);

 private:
  explicit WhepService(std::shared_ptr<HttpWaker> waker) : waker_(std::move(waker)) {}

  const std::shared_ptr<HttpWaker> waker_;
  std::string problem_;
  std::shared_ptr<WhepServer> server_;
  std::jthread thread_;
};

}  // namespace sightline
