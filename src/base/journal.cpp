// SPDX-License-Identifier: Apache-2.0
#include "base/journal.hpp"

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <cstdlib>
#include <cstring>

namespace sightline::base {
namespace {

bool is_journal_stream(int fd) {
  const char* const stream = std::getenv("JOURNAL_STREAM");
  struct stat info {};
  return stream != nullptr && ::fstat(fd, &info) == 0 &&
         fmt::format("{}:{}", info.st_dev, info.st_ino) == stream;
}

int priority(log::Level level) {
  switch (level) {
    case log::Level::kDebug:
      return 7;
    case log::Level::kInfo:
      return 6;
    case log::Level::kWarning:
      return 4;
    case log::Level::kError:
      return 3;
  }
  return 3;
}

// A value with line breaks has its length before it.
void append(std::string& to, std::string_view key, std::string_view value) {
  if (value.empty()) return;
  to += key;
  if (value.find('\n') == std::string_view::npos) {
    to += '=';
  } else {
    to += '\n';
    for (int i = 0; i < 8; ++i) to += static_cast<char>(uint64_t{value.size()} >> 8 * i & 0xFF);
  }
  to += value;
  to += '\n';
}

}  // namespace

std::string journal_message(log::Level level, std::string_view text, const log::Fields& fields,
                            std::string_view program) {
  std::string message;
  append(message, "MESSAGE", text);
  append(message, "PRIORITY", std::to_string(priority(level)));
  append(message, "SYSLOG_IDENTIFIER", program);
  append(message, "SIGHTLINE_CAMERA", fields.camera);
  append(message, "SIGHTLINE_OBJECT", fields.object);
  append(message, "SIGHTLINE_CAUSE", fields.cause);
  return message;
}

std::optional<JournalSocket> JournalSocket::open(int stderr_fd, const char* path) {
  if (!is_journal_stream(stderr_fd)) return std::nullopt;
  UniqueFd socket(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (!socket.is_open() || std::strlen(path) >= sizeof address.sun_path) return std::nullopt;
  std::strcpy(address.sun_path, path);
  if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return std::nullopt;
  }
  return JournalSocket(std::move(socket));
}

bool JournalSocket::send(std::string_view message) const {
  return ::send(socket_.get(), message.data(), message.size(), MSG_NOSIGNAL | MSG_DONTWAIT) ==
         static_cast<ssize_t>(message.size());
}

}  // namespace sightline::base
