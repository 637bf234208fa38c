// SPDX-License-Identifier: Apache-2.0
#include "sightline/control/http_content.hpp"

#include <sys/eventfd.h>

#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>

namespace sightline {
namespace {

unsigned status_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidInput:
      return 400;
    case ErrorCode::kNotFound:
      return 404;
    case ErrorCode::kUnavailable:
      return 503;
    case ErrorCode::kTimeout:
      return 504;
    default:
      return 500;
  }
}

}  // namespace

Result<std::shared_ptr<HttpWaker>> HttpWaker::create() {
  UniqueFd event(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (!event.is_open()) {
    return make_error(ErrorCode::kIo, "http", "eventfd: {}", std::strerror(errno));
  }
  return std::shared_ptr<HttpWaker>(new HttpWaker(std::move(event)));
}

void HttpWaker::wake() const { (void)::eventfd_write(event_.get(), 1); }

void HttpWaker::clear() const {
  eventfd_t count = 0;
  (void)::eventfd_read(event_.get(), &count);
}

HttpReply HttpReply::error(unsigned status, const std::string& text) {
  // What clients sent may stand in it, and need not be UTF-8.
  return {status, "application/json",
          nlohmann::json{{"error", text}}.dump(-1, ' ', false,
                                               nlohmann::json::error_handler_t::replace) +
              "\n"};
}

HttpReply HttpReply::error(const Error& error) {
  return HttpReply::error(status_of(error.code), error.message());
}

}  // namespace sightline
