// SPDX-License-Identifier: Apache-2.0
#include "control/connection_loop.hpp"

#include <linux/sockios.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

namespace sightline::control {
namespace {

using namespace std::chrono_literals;

// So long a new connection is safe from newer ones: time enough for a request that was sent at
// once, and a bound on what an attacker's reconnecting costs (connections / grace per second).
constexpr Duration kGrace = 100ms;
constexpr int kAcceptedPerTurn = 64;  // then those that are there are served
// Those that were cut are closed by libmicrohttpd a turn later.
constexpr unsigned kBeingClosed = 2 * kAcceptedPerTurn;
constexpr int kRestLook_ms = 50;               // what rests for a time, and not for a wake
constexpr size_t kMemoryPerConnection = 8192;  // [bytes] request line and headers have to fit

int milliseconds_until(Time time, Time now) {
  if (time <= now) return 0;
  const auto rounded_up = std::chrono::ceil<std::chrono::milliseconds>(time - now);
  return static_cast<int>(std::min<int64_t>(rounded_up.count(), 60'000));
}

}  // namespace

ConnectionLoop::ConnectionLoop(UniqueFd listener, const HttpOptions& options, Handler handler)
    : listener_(std::move(listener)),
      wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      handler_(std::move(handler)),
      table_(options.max_connections, options.deadline, std::min(kGrace, options.deadline)) {}

Result<std::unique_ptr<ConnectionLoop>> ConnectionLoop::create(UniqueFd listener,
                                                               const HttpOptions& options,
                                                               const TlsTexts& tls,
                                                               Handler handler) {
  std::unique_ptr<ConnectionLoop> loop(
      new ConnectionLoop(std::move(listener), options, std::move(handler)));
  if (!loop->wake_.is_open()) {
    return make_error(ErrorCode::kIo, "http", "eventfd: {}", std::strerror(errno));
  }
  const auto on_connection = [](void* self, MHD_Connection* connection, void** entry,
                                MHD_ConnectionNotificationCode what) {
    static_cast<ConnectionLoop*>(self)->on_connection(connection, entry, what);
  };
  const auto on_answer = [](void* self, MHD_Connection* connection, void** progress,
                            MHD_RequestTerminationCode) {
    auto* const own = static_cast<ConnectionLoop*>(self);
    own->on_answer(connection);
    own->handler_.completed(std::exchange(*progress, nullptr));
  };
  const bool secure = !tls.certificate.empty();
  MHD_OptionItem tls_options[] = {
      {MHD_OPTION_HTTPS_MEM_CERT, 0, const_cast<char*>(tls.certificate.c_str())},
      {MHD_OPTION_HTTPS_MEM_KEY, 0, const_cast<char*>(tls.key.c_str())},
      {MHD_OPTION_END, 0, nullptr}};
  MHD_OptionItem* const more = secure ? tls_options : tls_options + 2;
  const unsigned flags = MHD_USE_EPOLL | MHD_USE_NO_LISTEN_SOCKET | MHD_ALLOW_SUSPEND_RESUME |
                         (secure ? unsigned{MHD_USE_TLS} : 0U);
  loop->daemon_.reset(MHD_start_daemon(
      flags, 0, nullptr, nullptr, loop->handler_.handle, loop->handler_.context,
      MHD_OPTION_NOTIFY_CONNECTION, +on_connection, loop.get(), MHD_OPTION_NOTIFY_COMPLETED,
      +on_answer, loop.get(), MHD_OPTION_CONNECTION_LIMIT, options.max_connections + kBeingClosed,
      MHD_OPTION_CONNECTION_MEMORY_LIMIT, kMemoryPerConnection, MHD_OPTION_ARRAY, more,
      MHD_OPTION_END));
  if (!loop->daemon_ && secure) {
    return make_error(ErrorCode::kInvalidInput, "http",
                      "certificate and key under [access] cannot be used: they are damaged, or do "
                      "not belong together");
  }
  if (!loop->daemon_) {
    return make_error(ErrorCode::kInternal, "http", "the HTTP library does not start");
  }
  return loop;
}

// The library does not end with connections that rest.
ConnectionLoop::~ConnectionLoop() {
  for (const Suspended& suspended : suspended_) MHD_resume_connection(suspended.connection);
  suspended_.clear();
  daemon_.reset();
}

ConnectionTable::Entry* ConnectionLoop::entry_of(MHD_Connection* connection) {
  const auto* const info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
  if (info == nullptr) return nullptr;
  return static_cast<ConnectionTable::Entry*>(info->socket_context);
}

void ConnectionLoop::suspend(MHD_Connection* connection, std::function<bool()> ready) {
  if (ConnectionTable::Entry* const entry = entry_of(connection)) entry->resting = true;
  suspended_.push_back({connection, std::move(ready)});
  MHD_suspend_connection(connection);
}

void ConnectionLoop::goes_on(MHD_Connection* connection) {
  if (ConnectionTable::Entry* const entry = entry_of(connection)) {
    table_.answered(entry, MonotonicClock::now());
  }
}

void ConnectionLoop::resume_ready() {
  if (handler_.waker) handler_.waker->clear();
  suspended_.remove_if([this](const Suspended& suspended) {
    if (!suspended.ready()) return false;
    if (ConnectionTable::Entry* const entry = entry_of(suspended.connection)) {
      entry->resting = false;
      table_.answered(entry, MonotonicClock::now());
    }
    MHD_resume_connection(suspended.connection);
    return true;
  });
}

void ConnectionLoop::run(std::stop_token stop) {
  const std::stop_callback wake(stop, [this] { (void)::eventfd_write(wake_.get(), 1); });
  while (!stop.stop_requested()) {
    wait(MonotonicClock::now());
    accept_some();
    const Time now = MonotonicClock::now();
    while (ConnectionTable::Entry* entry = table_.overdue(now)) cut(entry);
    resume_ready();
    MHD_run(daemon_.get());
  }
}

void ConnectionLoop::wait(Time now) const {
  int timeout_ms = -1;
  const auto at_most = [&](int limit_ms) {
    timeout_ms = timeout_ms < 0 ? limit_ms : std::min(timeout_ms, limit_ms);
  };
  MHD_UNSIGNED_LONG_LONG library_ms = 0;
  if (MHD_get_timeout(daemon_.get(), &library_ms) == MHD_YES) {
    at_most(static_cast<int>(std::min<MHD_UNSIGNED_LONG_LONG>(library_ms, 60'000)));
  }
  if (const auto deadline = table_.next_deadline()) at_most(milliseconds_until(*deadline, now));
  if (!suspended_.empty()) at_most(kRestLook_ms);
  const bool accepting = now >= resume_;
  if (!accepting) at_most(milliseconds_until(resume_, now));
  const int library = MHD_get_daemon_info(daemon_.get(), MHD_DAEMON_INFO_EPOLL_FD)->epoll_fd;
  pollfd fds[] = {{wake_.get(), POLLIN, 0},
                  {library, POLLIN, 0},
                  {handler_.waker ? handler_.waker->fd() : -1, POLLIN, 0},
                  {accepting ? listener_.get() : -1, POLLIN, 0}};  // -1 is passed over
  (void)::poll(fds, std::size(fds), timeout_ms);
}

void ConnectionLoop::accept_some() {
  const Time now = MonotonicClock::now();
  if (now < resume_) return;
  for (int i = 0; i < kAcceptedPerTurn; ++i) {
    ConnectionTable::Entry* const yields = table_.full() ? table_.yields(now) : nullptr;
    if (table_.full() && yields == nullptr) return pause(table_.next_yield(now));
    sockaddr_storage address{};
    socklen_t length = sizeof address;
    auto* const peer = reinterpret_cast<sockaddr*>(&address);
    const int fd = ::accept4(listener_.get(), peer, &length, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (fd < 0) {
      if (errno == ECONNABORTED || errno == EINTR) continue;
      if (errno == EMFILE || errno == ENFILE || errno == ENOMEM || errno == ENOBUFS) exhausted(now);
      return;
    }
    if (yields != nullptr) cut(yields);
    (void)MHD_add_connection(daemon_.get(), fd, peer, length);  // closes it where it fails
  }
}

// Out of descriptors or memory: somebody has to go before anybody can come.
void ConnectionLoop::exhausted(Time now) {
  if (ConnectionTable::Entry* const entry = table_.yields(now)) cut(entry);
  pause(now + kGrace);
}

// libmicrohttpd sees the end of what it reads and closes the connection. Of an answer that nobody
// takes the kernel would keep the rest for minutes.
void ConnectionLoop::cut(ConnectionTable::Entry* entry) {
  int unsent = 0;
  if (::ioctl(entry->fd, SIOCOUTQ, &unsent) == 0 && unsent > 0) {
    const linger forget{1, 0};
    (void)::setsockopt(entry->fd, SOL_SOCKET, SO_LINGER, &forget, sizeof forget);
  }
  ::shutdown(entry->fd, SHUT_RDWR);
  table_.cut(entry);
}

void ConnectionLoop::on_connection(MHD_Connection* connection, void** entry,
                                   MHD_ConnectionNotificationCode what) {
  if (what == MHD_CONNECTION_NOTIFY_CLOSED) {
    if (*entry != nullptr) table_.remove(static_cast<ConnectionTable::Entry*>(*entry));
    return;
  }
  const auto* const fd = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
  const int connect_fd = fd->connect_fd;
  const auto* const address =
      MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);
  *entry = table_.add(connect_fd, peer_key(address->client_addr), MonotonicClock::now());
}

void ConnectionLoop::on_answer(MHD_Connection* connection) { goes_on(connection); }

}  // namespace sightline::control
