// SPDX-License-Identifier: Apache-2.0
#include "stream/rtsp_connections.hpp"

#include <sys/socket.h>

#include <algorithm>

#include "sightline/base/log.hpp"
#include "stream/gst_ptr.hpp"

namespace sightline::stream {
namespace {

/// IPv4 in whole, also where it comes as IPv6; of other IPv6 the network's half.
std::string counted_address(GInetAddress* address, const std::string& text) {
  constexpr std::string_view kMapped = "::ffff:";
  if (text.starts_with(kMapped)) return text.substr(kMapped.size());
  if (g_inet_address_get_family(address) != G_SOCKET_FAMILY_IPV6) return text;
  const guint8* bytes = g_inet_address_to_bytes(address);
  std::string network;
  for (int i = 0; i < 8; ++i) network += fmt::format("{:02x}", bytes[i]);
  return network + "/64";
}

struct Counts {
  int here = 0;         ///< of all addresses, leaving ones not counted
  int of_newcomer = 0;  ///< of the newcomer's address
  int leaving = 0;
  std::map<std::string, int> by_address;
};

Counts count(std::span<const Occupant> occupants, const RemoteHost& newcomer) {
  Counts counts;
  for (const Occupant& occupant : occupants) {
    if (occupant.leaving) {
      ++counts.leaving;
      continue;
    }
    ++counts.here;
    ++counts.by_address[occupant.counted_as];
    if (occupant.counted_as == newcomer.counted_as) ++counts.of_newcomer;
  }
  return counts;
}

int limit_of_address(const RemoteHost& newcomer, const ConnectionLimits& limits) {
  if (limits.per_address > 0) return limits.per_address;
  return newcomer.loopback ? limits.total : std::max(1, limits.total * 3 / 4);
}

}  // namespace

std::optional<RemoteHost> peer_of(GSocket* socket) {
  const GObjectPtr<GSocketAddress> remote(g_socket_get_remote_address(socket, nullptr));
  if (!remote || !G_IS_INET_SOCKET_ADDRESS(remote.get())) return std::nullopt;
  auto* inet = G_INET_SOCKET_ADDRESS(remote.get());
  GInetAddress* address = g_inet_socket_address_get_address(inet);
  const GStringPtr text(g_inet_address_to_string(address));
  RemoteHost peer;
  peer.address = text.get();
  peer.counted_as = counted_address(address, peer.address);
  peer.port = g_inet_socket_address_get_port(inet);
  peer.loopback = g_inet_address_get_is_loopback(address) || peer.counted_as.starts_with("127.");
  return peer;
}

Admission admit(std::span<const Occupant> occupants, const RemoteHost& newcomer,
                const ConnectionLimits& limits) {
  const Counts counts = count(occupants, newcomer);
  if (counts.leaving > limits.total) return {};
  const bool address_full = counts.of_newcomer >= limit_of_address(newcomer, limits);
  if (!address_full && counts.here < limits.total) return {true, std::nullopt};
  std::optional<size_t> leaves;
  const auto goes_before = [&](const Occupant& a, const Occupant& b) {
    const int of_a = counts.by_address.at(a.counted_as), of_b = counts.by_address.at(b.counted_as);
    return of_a != of_b ? of_a > of_b : a.since < b.since;
  };
  for (size_t i = 0; i < occupants.size(); ++i) {
    const Occupant& one = occupants[i];
    if (one.leaving || !one.idle) continue;
    if (address_full && one.counted_as != newcomer.counted_as) continue;
    if (!leaves || goes_before(one, occupants[*leaves])) leaves = i;
  }
  return {leaves.has_value(), leaves};
}

void RtspConnections::end(Connection& connection) {
  connection.leaving = true;
  shutdown(connection.socket.get(), SHUT_RDWR);
}

bool RtspConnections::make_room(const RemoteHost& newcomer) {
  std::lock_guard lock(mutex_);
  std::vector<Occupant> occupants;
  std::vector<Connection*> by_index;
  for (auto& [client, connection] : connections_) {
    by_index.push_back(&connection);
    occupants.push_back({connection.peer.counted_as, connection.since,
                         !connection.leaving && !has_session_(client), connection.leaving});
  }
  const Admission admission = admit(occupants, newcomer, limits_);
  if (admission.instead_of) end(*by_index[*admission.instead_of]);
  return admission.admitted;
}

void RtspConnections::wrong_password(const void* client, Time now) {
  std::lock_guard lock(mutex_);
  const auto found = connections_.find(client);
  if (found == connections_.end()) return;
  guesses_.count(found->second.peer.counted_as, now);
  if (guesses_.exhausted(found->second.peer.counted_as, now)) end(found->second);
}

void RtspConnections::answered(const void* client) {
  std::lock_guard lock(mutex_);
  const auto found = connections_.find(client);
  if (found != connections_.end() && found->second.input) found->second.input->guard.answered();
}

bool RtspConnections::guessed_too_often(const RemoteHost& newcomer, Time now) {
  std::lock_guard lock(mutex_);
  return guesses_.exhausted(newcomer.counted_as, now);
}

void RtspConnections::add(const void* client, Connection connection) {
  std::lock_guard lock(mutex_);
  connections_.insert_or_assign(client, std::move(connection));
}

void RtspConnections::remove(const void* client) {
  Connection gone;
  {
    std::lock_guard lock(mutex_);
    const auto found = connections_.find(client);
    if (found == connections_.end()) return;
    gone = std::move(found->second);
    connections_.erase(found);
  }
  ::shutdown(gone.socket.get(), SHUT_RDWR);  // so that closing waits for nobody
  if (gone.tls) g_io_stream_close(gone.tls.get(), nullptr, nullptr);
}

int RtspConnections::count() const {
  std::lock_guard lock(mutex_);
  return static_cast<int>(connections_.size());
}

void RtspConnections::end_if(const std::function<bool(const void* client)>& chosen) {
  std::lock_guard lock(mutex_);
  for (auto& [client, connection] : connections_) {
    if (chosen(client)) end(connection);
  }
}

bool RtspConnections::is_overdue(const void* client, const Connection& connection, Time now) const {
  const RequestGuard& guard = connection.input->guard;
  const Time begun = guard.unfinished_since();
  if (begun != Time{} && now - begun > kRequestTime) return true;
  if (guard.requests() == 0) return now - connection.since > kRequestTime;
  return now - connection.since > kIdleTime && !has_session_(client);
}

void RtspConnections::end_overdue(Time now) {
  std::lock_guard lock(mutex_);
  for (auto& [client, connection] : connections_) {
    if (!connection.leaving && is_overdue(client, connection, now)) end(connection);
  }
}

void SeldomWarning::warn(const std::string& text, Time now) {
  constexpr Duration kSpacing = std::chrono::seconds(10);
  std::lock_guard lock(mutex_);
  if (last_ && now - *last_ < kSpacing) {
    ++left_out_;
    return;
  }
  log::warning("{}{}", text,
               left_out_ == 0 ? "" : fmt::format(" ({} more like it before)", left_out_));
  last_ = now;
  left_out_ = 0;
}

}  // namespace sightline::stream
