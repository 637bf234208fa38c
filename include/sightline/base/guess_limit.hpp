// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <map>

#include "sightline/base/time.hpp"

namespace sightline {

/// How often each peer may try a wrong password: so many within a minute, and then no more (nor a
/// right one: nothing is learned) for the rest of it. Remembers a bounded number of peers, those
/// that began last. Passive and without a clock of its own; one thread.
template <typename Peer>
class GuessLimit {
 public:
  static constexpr int kGuesses = 10;                           ///< wrong ones of one peer ...
  static constexpr Duration kWindow = std::chrono::minutes(1);  ///< ... in this time
  static constexpr size_t kMostPeers = 1024;                    ///< that are remembered

  /// True while this peer has had its guesses.
  bool exhausted(const Peer& peer, Time now) {
    const auto found = peers_.find(peer);
    if (found == peers_.end()) return false;
    if (found->second.since + kWindow <= now) {
      peers_.erase(found);
      return false;
    }
    return found->second.count >= kGuesses;
  }

  void count(const Peer& peer, Time now) {
    if (!peers_.contains(peer) && peers_.size() >= kMostPeers) {
      peers_.erase(std::ranges::min_element(peers_, {},
                                            [](const auto& entry) { return entry.second.since; }));
    }
    Guesses& guesses = peers_[peer];
    if (guesses.count++ == 0) guesses.since = now;
  }

 private:
  struct Guesses {
    int count = 0;
    Time since{};
  };
  std::map<Peer, Guesses> peers_;
};

}  // namespace sightline
