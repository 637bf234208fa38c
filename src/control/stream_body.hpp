// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <microhttpd.h>

#include <memory>
#include <optional>

#include "control/connection_loop.hpp"
#include "sightline/control/http_content.hpp"

namespace sightline::control {

/// A response whose body is `stream`; the connection rests while that has nothing. `length`
/// as HttpReply::length. `count` is one more while it is sent. Null if there is no memory.
MHD_Response* make_stream_response(ConnectionLoop& loop, MHD_Connection* connection,
                                   std::shared_ptr<HttpStream> stream,
                                   std::optional<uint64_t> length, unsigned& count);

}  // namespace sightline::control
