// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gio/gio.h>

#include <functional>
#include <memory>

#include "stream/request_guard.hpp"

namespace sightline::stream {

/// What is asked of everything that one client sends.
struct GuardedInput {
  RequestGuard guard;
  /// On the client's thread, at most once: the guard refused something, the connection is ending.
  std::function<void(RequestGuard::Verdict)> on_refusal;
};

/// Every byte that GIO reads from this socket passes the guard first; what the guard refuses reads
/// as the end of the connection. Before a GSocketConnection is made of the socket, which
/// gst-rtsp-server does itself.
void guard_socket(GSocket* socket, std::shared_ptr<GuardedInput> input);

}  // namespace sightline::stream
