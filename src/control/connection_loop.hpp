// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <microhttpd.h>

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
  /// `handler` is called with `context`, on the thread of run().
  static Result<std::unique_ptr<ConnectionLoop>> create(UniqueFd listener,
                                                        const HttpOptions& options,
                                                        MHD_AccessHandlerCallback handler,
                                                        void* context);
  void run(std::stop_token stop);

 private:
  ConnectionLoop(UniqueFd listener, const HttpOptions& options);
  /// Until something can be done; the listener is left out before `resume_`.
  void wait(Time now) const;
  void accept_some();
  void exhausted(Time now);
  void pause(Time until) { resume_ = until; }
  void cut(ConnectionTable::Entry* entry);
  void on_connection(MHD_Connection* connection, void** entry, MHD_ConnectionNotificationCode what);
  void on_answer(MHD_Connection* connection);

  struct StopDaemon {
    void operator()(MHD_Daemon* daemon) const { MHD_stop_daemon(daemon); }
  };
  const UniqueFd listener_;
  UniqueFd wake_;  ///< an event: stop
  ConnectionTable table_;
  Time resume_{};                                   ///< nobody is accepted before
  std::unique_ptr<MHD_Daemon, StopDaemon> daemon_;  ///< last: its end calls back
};

}  // namespace sightline::control
