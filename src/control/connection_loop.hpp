// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <microhttpd.h>

#include <functional>
#include <list>
#include <memory>
#include <stop_token>

#include "control/connection_table.hpp"
#include "sightline/base/result.hpp"
#include "sightline/base/unique_fd.hpp"
#include "sightline/control/http_server.hpp"

namespace sightline::control {

/// Accepts connections, gives them to libmicrohttpd, and closes those that take too long or too
/// much room. libmicrohttpd itself only limits how long a connection is silent, and refuses the
/// newest when there are too many. One thread.
class ConnectionLoop {
 public:
  /// Who answers. All calls come on the thread of run(), or at the end of the loop's life.
  struct Handler {
    MHD_AccessHandlerCallback handle;
    void* context = nullptr;             ///< first argument of `handle`
    void (*completed)(void* progress);   ///< a request has ended; never null inside
    std::shared_ptr<HttpWaker> waker{};  ///< null: suspended ones are asked on time alone
  };
  static Result<std::unique_ptr<ConnectionLoop>> create(UniqueFd listener,
                                                        const HttpOptions& options,
                                                        const TlsTexts& tls, Handler handler);
  ~ConnectionLoop();
  void run(std::stop_token stop);

  /// From inside the handler or the reader of a body: this connection rests, without a deadline,
  /// until `ready` says so. It is asked whenever the waker was used, and 20 times a second.
  void suspend(MHD_Connection* connection, std::function<bool()> ready);
  /// Something of an answer without an end was taken: the deadline of the rest starts.
  void goes_on(MHD_Connection* connection);

 private:
  ConnectionLoop(UniqueFd listener, const HttpOptions& options, Handler handler);
  /// Until something can be done; the listener is left out before `resume_`.
  void wait(Time now) const;
  void accept_some();
  void exhausted(Time now);
  void pause(Time until) { resume_ = until; }
  void cut(ConnectionTable::Entry* entry);
  void on_connection(MHD_Connection* connection, void** entry, MHD_ConnectionNotificationCode what);
  void on_answer(MHD_Connection* connection);
  void resume_ready();
  static ConnectionTable::Entry* entry_of(MHD_Connection* connection);

  struct StopDaemon {
    void operator()(MHD_Daemon* daemon) const { MHD_stop_daemon(daemon); }
  };
  const UniqueFd listener_;
  UniqueFd wake_;  ///< an event: stop
  const Handler handler_;
  ConnectionTable table_;
  struct Suspended {
    MHD_Connection* connection;
    std::function<bool()> ready;
  };
  std::list<Suspended> suspended_;
  Time resume_{};                                   ///< nobody is accepted before
  std::unique_ptr<MHD_Daemon, StopDaemon> daemon_;  ///< last: its end calls back
};

}  // namespace sightline::control
