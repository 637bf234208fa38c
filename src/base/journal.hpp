// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "sightline/base/log.hpp"
#include "sightline/base/unique_fd.hpp"

namespace sightline::base {

/// One message in the journal's native protocol (https://systemd.io/JOURNAL_NATIVE_PROTOCOL):
/// MESSAGE, PRIORITY, SYSLOG_IDENTIFIER and, where they are not empty, SIGHTLINE_CAMERA,
/// SIGHTLINE_OBJECT and SIGHTLINE_CAUSE.
std::string journal_message(log::Level level, std::string_view text, const log::Fields& fields,
                            std::string_view program);

/// Sends messages to the journal with their fields. sd_journal_send() would do, but waits while
/// the journal does not read. Any thread.
class JournalSocket {
 public:
  static constexpr const char* kPath = "/run/systemd/journal/socket";

  /// Nullopt unless `stderr_fd` is the journal's stream ($JOURNAL_STREAM says which that is) and
  /// the socket is there.
  static std::optional<JournalSocket> open(int stderr_fd, const char* path = kPath);
  /// False: it was not taken, now or at all.
  bool send(std::string_view message) const;

 private:
  explicit JournalSocket(UniqueFd socket) : socket_(std::move(socket)) {}
  UniqueFd socket_;
};

}  // namespace sightline::base
