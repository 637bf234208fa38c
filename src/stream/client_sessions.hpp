// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace sightline::stream {

/// Which RTSP sessions a connection has begun. The library keeps those of a lost connection until
/// they time out, and counts them: viewers that come back a few times a minute would find the
/// server full of themselves. Any thread.
class ClientSessions {
 public:
  void add(const void* client, std::string session) {
    std::lock_guard lock(mutex_);
    begun_.emplace(client, std::move(session));
  }
  /// The sessions of a client, which are forgotten.
  std::vector<std::string> take(const void* client) {
    std::vector<std::string> sessions;
    std::lock_guard lock(mutex_);
    const auto [first, last] = begun_.equal_range(client);
    for (auto it = first; it != last; ++it) sessions.push_back(it->second);
    begun_.erase(first, last);
    return sessions;
  }
  /// A session that has ended.
  void forget(const std::string& session) {
    std::lock_guard lock(mutex_);
    std::erase_if(begun_, [&](const auto& begun) { return begun.second == session; });
  }

 private:
  std::mutex mutex_;
  std::multimap<const void*, std::string> begun_;
};

}  // namespace sightline::stream
