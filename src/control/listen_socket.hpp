// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "sightline/base/result.hpp"
#include "sightline/base/unique_fd.hpp"

namespace sightline::control {

struct ListenSocket {
  UniqueFd fd;
  uint16_t port = 0;
  bool loopback = false;
};

/// A listening, non-blocking TCP socket on a numeric address (IPv4 or IPv6). Refuses an address
/// that is not loopback unless `allow_remote`; port 0 takes any free one.
Result<ListenSocket> open_listen_socket(const std::string& address, uint16_t port,
                                        bool allow_remote);

}  // namespace sightline::control
