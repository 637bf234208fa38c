// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/base/unique_fd.hpp"

namespace sightline {

/// SIGTERM, SIGINT and SIGHUP as something to wait for. Create it before the first thread: the
/// signals are blocked then in all of them. SIGPIPE is ignored.
class Signals {
 public:
  static Result<Signals> create();
  /// The next signal number, or 0 when `timeout` ends first.
  int wait(Duration timeout) const;

 private:
  explicit Signals(UniqueFd fd) : fd_(std::move(fd)) {}
  UniqueFd fd_;
};

}  // namespace sightline
