// SPDX-License-Identifier: Apache-2.0
#include "control/connection_table.hpp"

#include <netinet/in.h>

#include <algorithm>
#include <cstring>

namespace sightline::control {

PeerKey peer_key(const sockaddr* address) {
  PeerKey key{};
  if (address == nullptr) return key;
  if (address->sa_family == AF_INET) {
    std::memcpy(key.data(), &reinterpret_cast<const sockaddr_in*>(address)->sin_addr, 4);
  } else if (address->sa_family == AF_INET6) {
    const auto& bytes = reinterpret_cast<const sockaddr_in6*>(address)->sin6_addr;
    // IPv4 clients of a socket that takes both.
    const bool mapped = IN6_IS_ADDR_V4MAPPED(&bytes);
    std::memcpy(key.data(), bytes.s6_addr + (mapped ? 12 : 0), mapped ? 4 : 8);
  }
  return key;
}

ConnectionTable::Entry* ConnectionTable::add(int fd, const PeerKey& peer, Time now) {
  ++per_peer_[peer];
  ++waiting_;
  return &entries_.emplace_back(Entry{fd, peer, now});
}

void ConnectionTable::cut(Entry* entry) {
  if (entry->cut) return;
  entry->cut = true;
  --waiting_;
  const auto peer = per_peer_.find(entry->peer);
  if (--peer->second == 0) per_peer_.erase(peer);
}

void ConnectionTable::remove(Entry* entry) {
  cut(entry);
  entries_.remove_if([entry](const Entry& other) { return &other == entry; });
}

void ConnectionTable::answered(Entry* entry, Time now) { entry->since = now; }

ConnectionTable::Entry* ConnectionTable::yields(Time now) {
  Entry* best = nullptr;
  size_t best_count = 0;
  for (Entry& entry : entries_) {
    if (entry.cut || entry.resting || entry.since + grace_ > now) continue;
    const size_t count = per_peer_.at(entry.peer);
    if (best == nullptr || count > best_count ||
        (count == best_count && entry.since < best->since)) {
      best = &entry;
      best_count = count;
    }
  }
  return best;
}

ConnectionTable::Entry* ConnectionTable::overdue(Time now) {
  const auto found = std::ranges::find_if(entries_, [&](const Entry& entry) {
    return !entry.cut && !entry.resting && entry.since + deadline_ <= now;
  });
  return found == entries_.end() ? nullptr : &*found;
}

std::optional<Time> ConnectionTable::next_deadline() const {
  std::optional<Time> first;
  for (const Entry& entry : entries_) {
    if (!entry.cut && !entry.resting && (!first || entry.since + deadline_ < *first)) {
      first = entry.since + deadline_;
    }
  }
  return first;
}

Time ConnectionTable::next_yield(Time now) const {
  Time first = now + grace_;
  for (const Entry& entry : entries_) {
    if (!entry.cut && !entry.resting) first = std::min(first, entry.since + grace_);
  }
  return first;
}

}  // namespace sightline::control
