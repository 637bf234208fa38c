// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/socket.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <optional>

#include "sightline/base/time.hpp"

namespace sightline::control {

/// Whom connections are counted for: an IPv4 address, or the /64 network of an IPv6 one, since one
/// host has all addresses of that.
using PeerKey = std::array<uint8_t, 8>;
PeerKey peer_key(const sockaddr* address);

/// The open connections of a server, who holds them and since when each owes the rest of its
/// request. Passive and without a clock of its own; one thread.
class ConnectionTable {
 public:
  struct Entry {
    int fd = -1;
    PeerKey peer{};
    Time since{};          ///< accepted, or its last answer sent
    bool resting = false;  ///< waits for us: it owes nothing, and does not give way
    bool cut = false;      ///< told to go; nothing more is expected of it
  };
  /// `most` connections. Each has until `deadline` after its `since`; none has to give way to
  /// another within `grace` of it.
  ConnectionTable(size_t most, Duration deadline, Duration grace)
      : most_(most), deadline_(deadline), grace_(grace) {}

  /// Valid until remove().
  Entry* add(int fd, const PeerKey& peer, Time now);
  void remove(Entry* entry);
  /// An answer has been sent: the deadline of the next request starts.
  void answered(Entry* entry, Time now);
  void cut(Entry* entry);

  bool full() const { return waiting_ >= most_; }
  /// All entries, those that were cut among them.
  size_t size() const { return entries_.size(); }
  /// Who gives way to a new connection: of the peers with the most connections the one that has
  /// owed its request longest. Null if that is not longer than the grace.
  Entry* yields(Time now);
  /// The first that is past its deadline; null: none.
  Entry* overdue(Time now);
  /// When overdue() has one next; nothing: never.
  std::optional<Time> next_deadline() const;
  /// When yields() has one at the latest.
  Time next_yield(Time now) const;

 private:
  const size_t most_;
  const Duration deadline_, grace_;
  std::list<Entry> entries_;
  std::map<PeerKey, size_t> per_peer_;  ///< of those that were not cut
  size_t waiting_ = 0;                  ///< the same, of all peers
};

}  // namespace sightline::control
