// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/base/unique_fd.hpp"

namespace sightline::capture {

/// The TCP sockets that an element of GStreamer opens for one camera. It keeps them to itself,
/// reads answers without an end from them, and does not stop when it is told to; this tells how
/// much has come, and cuts them. Any thread.
class NetworkSockets {
 public:
  /// Sockets that GLib opens in the calling thread from now on are those of `owner`, until it is
  /// gone or the thread is another's.
  static void claim_thread(const std::shared_ptr<NetworkSockets>& owner);

  /// Bytes that have come, as the kernel counts them.
  uint64_t received() const;
  /// Ends all connections, and those that would still be made: whoever reads gets the end of file.
  void cut();

 private:
  friend struct SocketHook;
  void add(int fd);

  mutable std::mutex mutex_;
  std::vector<UniqueFd> sockets_;  // duplicates: GStreamer may close its own at any time
  uint64_t received_by_gone_ = 0;
  bool cut_ = false;
};

}  // namespace sightline::capture
