// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "control/api_requests.hpp"
#include "sightline/control/access.hpp"
#include "sightline/control/http_content.hpp"

namespace sightline::control {

struct Request {
  std::string path;
  Query query;
  std::string body;
  std::string user;     ///< whose token it came with; empty: nobody's
  std::string range;    ///< header of that name
  std::string address;  ///< numeric, of this host, as it was reached; "" if that is not known
};

/// One line of what is served.
struct Route {
  std::string_view method;   ///< "GET" (HEAD too), "POST", "PUT" or "DELETE"
  std::string_view pattern;  ///< "{name}" stands for one part of a path, "{path}" for two
  Role role;                 ///< that it takes at least
  HttpReply (*answer)(const HttpContent&, const Request&, const std::string& name);
  std::string_view body = "application/json";  ///< that POST and PUT take
};
std::span<const Route> routes();

struct Match {
  const Route* route = nullptr;  ///< null: no such path, or only with another method
  std::string name;              ///< what stands for "{name}"
  std::string allowed;           ///< methods that the path has, "" if there is no such path
};
/// `method` with HEAD as GET.
Match match(std::string_view method, std::string_view path);

/// A file of the page, or the API's description; served as they are.
struct Asset {
  std::string_view path;
  std::string_view type;
  std::string_view bytes;
};
std::span<const Asset> assets();

}  // namespace sightline::control
