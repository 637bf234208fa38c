// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "sightline/base/result.hpp"

namespace sightline::capture {

/// A camera's address, taken apart.
struct NetworkUrl {
  std::string scheme;    ///< "rtsp", "rtsps", "http", "https"
  std::string location;  ///< whole, without user and password
  std::string shown;     ///< for messages: without user, password and query
  std::string user, password;

  bool is_rtsp() const { return scheme.starts_with("rtsp"); }
};

/// Errors never repeat what may be a password.
Result<NetworkUrl> parse_network_url(const std::string& url, const std::string& where);

}  // namespace sightline::capture
