// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <microhttpd.h>

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "control/connection_loop.hpp"
#include "control/gatekeeper.hpp"
#include "control/router.hpp"

namespace sightline::control {

/// What all requests of a server share.
struct Service {
  HttpContent content;
  HttpOptions options;
  bool loopback = true;
  Gatekeeper gatekeeper;
  unsigned streams = 0;  ///< being sent now
  ConnectionLoop* loop = nullptr;
};

/// One request and its answer. One thread.
class Exchange {
 public:
  Exchange(Service& service, MHD_Connection* connection, std::string_view path,
           std::string_view method);

  /// What libmicrohttpd calls with the headers, each piece of the body, the end, and after every
  /// suspension.
  MHD_Result go_on(const char* upload, size_t* upload_size);

 private:
  /// By the headers alone; nullopt: welcome.
  std::optional<HttpReply> judge();
  std::optional<HttpReply> judge_origin() const;
  std::optional<HttpReply> judge_user();
  std::optional<HttpReply> judge_body() const;
  HttpReply answer();
  MHD_Result wait_for(std::function<std::optional<HttpReply>()> later);
  MHD_Result send(HttpReply reply);
  std::string header(const char* name) const;

  Service& service_;
  MHD_Connection* const connection_;
  const std::string method_;
  Request request_;
  Match match_;
  bool judged_ = false;
  std::optional<HttpReply> late_;  ///< that was waited for
};

}  // namespace sightline::control
