// SPDX-License-Identifier: Apache-2.0
#include "capture/network/network_sockets.hpp"

#include <fcntl.h>
#include <gio/gio.h>
// Not <netinet/tcp.h>: its tcp_info ends before the counters of bytes.
#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace sightline::capture {
namespace {

constexpr size_t kMaxSockets = 4;  // one and its successors: redirected, connected again

thread_local std::weak_ptr<NetworkSockets> owner_of_thread;

uint64_t received_by(int fd) {
  tcp_info info{};
  socklen_t size = sizeof info;
  return ::getsockopt(fd, IPPROTO_TCP, TCP_INFO, &info, &size) == 0 ? info.tcpi_bytes_received : 0;
}

}  // namespace

struct SocketHook {
  // Emitted by GSocketClient in the thread that connects, also deep inside of GStreamer.
  static gboolean on_event(GSignalInvocationHint*, guint count, const GValue* values, gpointer) {
    const auto owner = owner_of_thread.lock();
    if (!owner || count < 4 || g_value_get_enum(&values[1]) != G_SOCKET_CLIENT_CONNECTING) {
      return TRUE;
    }
    gpointer connection = g_value_get_object(&values[3]);
    if (connection != nullptr && G_IS_SOCKET_CONNECTION(connection)) {
      owner->add(g_socket_get_fd(g_socket_connection_get_socket(G_SOCKET_CONNECTION(connection))));
    }
    return TRUE;  // stay
  }

  static void install() {
    static const gulong hook = [] {
      g_type_class_ref(G_TYPE_SOCKET_CLIENT);
      return g_signal_add_emission_hook(g_signal_lookup("event", G_TYPE_SOCKET_CLIENT), 0,
                                        &SocketHook::on_event, nullptr, nullptr);
    }();
    (void)hook;
  }
};

void NetworkSockets::claim_thread(const std::shared_ptr<NetworkSockets>& owner) {
  SocketHook::install();
  owner_of_thread = owner;
}

void NetworkSockets::add(int fd) {
  UniqueFd mine(::fcntl(fd, F_DUPFD_CLOEXEC, 0));
  if (!mine.is_open()) return;
  std::lock_guard lock(mutex_);
  if (cut_) ::shutdown(mine.get(), SHUT_RDWR);
  if (sockets_.size() == kMaxSockets) {
    received_by_gone_ += received_by(sockets_.front().get());
    sockets_.erase(sockets_.begin());
  }
  sockets_.push_back(std::move(mine));
}

uint64_t NetworkSockets::received() const {
  std::lock_guard lock(mutex_);
  uint64_t sum = received_by_gone_;
  for (const UniqueFd& socket : sockets_) sum += received_by(socket.get());
  return sum;
}

void NetworkSockets::cut() {
  std::lock_guard lock(mutex_);
  cut_ = true;
  for (const UniqueFd& socket : sockets_) ::shutdown(socket.get(), SHUT_RDWR);
}

}  // namespace sightline::capture
