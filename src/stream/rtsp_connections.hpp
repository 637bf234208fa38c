// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sightline/base/guess_limit.hpp"
#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/base/unique_fd.hpp"
#include "stream/guarded_socket.hpp"

namespace sightline::stream {

/// Who is at the other end. Connections of one /64 of IPv6 count as one address: a host has a whole
/// one to itself.
struct RemoteHost {
  std::string address;  ///< numeric
  std::string counted_as;
  uint16_t port = 0;
  bool loopback = false;
};
/// Of a connected socket; nothing if it has gone already.
std::optional<RemoteHost> peer_of(GSocket* socket);

struct ConnectionLimits {
  int total = 32;
  /// Of one address. 0: three quarters of `total`, so that no other host takes every place, and no
  /// limit for this host, all of whose viewers have the same address.
  int per_address = 0;
};

/// What the admission of a new connection looks at.
struct Occupant {
  std::string counted_as;
  Time since{};
  bool idle = false;     ///< has no session
  bool leaving = false;  ///< was told to end, and holds no place any more
};
struct Admission {
  bool admitted = false;
  std::optional<size_t> instead_of;  ///< index of an idle occupant that has to leave
};
/// Idle connections give way: those of the newcomer's address where that has all it may have, else
/// those of the address that has the most; the oldest first. Refuses where none is idle, and while
/// more than `total` are leaving (each keeps a thread until it has left).
Admission admit(std::span<const Occupant> occupants, const RemoteHost& newcomer,
                const ConnectionLimits& limits);

/// The connections of a server, by the library's client object. Connections end by shutting their
/// socket down: their own threads, which may be reading, find that out and close them. (Closing
/// from another thread takes the stream away under the reader, which then reads nothing for ever.)
///
/// Any thread. Callbacks are called under a lock: they may not come back here.
class RtspConnections {
 public:
  struct Connection {
    RemoteHost peer;
    std::shared_ptr<GuardedInput> input;
    /// Of the same connection as the library's, so that it can be shut down whatever the library
    /// has closed meanwhile.
    UniqueFd socket;
    Time since{};
    bool leaving = false;
    std::shared_ptr<GIOStream> tls = {};  ///< null: plain
  };
  using HasSession = bool (*)(const void* client);

  RtspConnections(ConnectionLimits limits, HasSession has_session)
      : limits_(limits), has_session_(has_session) {}

  /// False if there is no room; else an idle connection may have been ended to make it.
  bool make_room(const RemoteHost& newcomer);
  /// This client brought a wrong password. After as many as an address may try its connection ends,
  /// and no other from there has room for a minute; those that play go on.
  void wrong_password(const void* client, Time now);
  /// An answer goes out to this client.
  void answered(const void* client);
  bool guessed_too_often(const RemoteHost& newcomer, Time now);
  void add(const void* client, Connection connection);
  /// Closes what speaks TLS: the library only lets go of it, and a handshake that failed holds on
  /// to its connection until somebody asks how it went.
  void remove(const void* client);
  /// Connections that have not gone yet.
  int count() const;
  void end_if(const std::function<bool(const void* client)>& chosen);
  /// Ends those that do not come to the point: a request that is begun is finished within
  /// kRequestTime, the first within that of connecting, and there is a session within kIdleTime.
  void end_overdue(Time now);

  static constexpr Duration kRequestTime = std::chrono::seconds(10);
  static constexpr Duration kIdleTime = std::chrono::seconds(20);

 private:
  static void end(Connection& connection);
  bool is_overdue(const void* client, const Connection& connection, Time now) const;

  const ConnectionLimits limits_;
  const HasSession has_session_;
  mutable std::mutex mutex_;
  std::map<const void*, Connection> connections_;
  GuessLimit<std::string> guesses_;  // by RemoteHost::counted_as
};

/// Lines of the log that strangers can cause: one in ten seconds, with the number of those left
/// out. Any thread.
class SeldomWarning {
 public:
  void warn(const std::string& text, Time now);

 private:
  std::mutex mutex_;
  std::optional<Time> last_;
  int left_out_ = 0;
};

}  // namespace sightline::stream
