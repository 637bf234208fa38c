// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace sightline::control {

/// True if the value of a Host header is exactly this machine's loopback, with or without a port:
/// "localhost" in any case, an IPv4 address of 127.0.0.0/8 as four decimal numbers, or "[::1]". A
/// page of another site that a browser was talked into resolving to 127.0.0.1 (DNS rebinding) has
/// its own name there, whatever that begins with. Any thread.
bool names_loopback(std::string_view host);

/// True if it is a numeric address, this machine's own name (alone, or with ".local"), or one of
/// `names`, with or without a port. Any thread.
bool names_this(std::string_view host, const std::vector<std::string>& names);

}  // namespace sightline::control
