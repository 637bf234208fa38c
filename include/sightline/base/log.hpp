// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <string_view>
#include <utility>

namespace sightline::log {

enum class Level { kDebug, kInfo, kWarning, kError };

/// What an event is about, for who filters: `journalctl SIGHTLINE_CAMERA=left -o json`. Empty ones
/// are left out; elsewhere than in the journal only the line is seen.
struct Fields {
  std::string_view camera{}, object{};
  std::string_view cause{};  ///< one word, as metrics have it: "absent", "silent", "disk"
};

/// Under systemd (stderr is the journal's) to the journal, with its fields. Else to stderr: with
/// time and color on a terminal, with "<N>" syslog priorities before each line where JOURNAL_STREAM
/// is set. Thread-safe; the default level is kInfo.
void set_level(Level level);
Level level();
void write(Level level, std::string_view line, const Fields& fields = {});

template <typename... Args>
void debug(fmt::format_string<Args...> format, Args&&... args) {
  if (level() <= Level::kDebug) {
    write(Level::kDebug, fmt::format(format, std::forward<Args>(args)...));
  }
}
template <typename... Args>
void info(fmt::format_string<Args...> format, Args&&... args) {
  write(Level::kInfo, fmt::format(format, std::forward<Args>(args)...));
}
template <typename... Args>
void warning(fmt::format_string<Args...> format, Args&&... args) {
  write(Level::kWarning, fmt::format(format, std::forward<Args>(args)...));
}
template <typename... Args>
void error(fmt::format_string<Args...> format, Args&&... args) {
  write(Level::kError, fmt::format(format, std::forward<Args>(args)...));
}

// The same with fields: `log::warning({.camera = name}, "{}: ...", name)`.
template <typename... Args>
void info(const Fields& fields, fmt::format_string<Args...> format, Args&&... args) {
  write(Level::kInfo, fmt::format(format, std::forward<Args>(args)...), fields);
}
template <typename... Args>
void warning(const Fields& fields, fmt::format_string<Args...> format, Args&&... args) {
  write(Level::kWarning, fmt::format(format, std::forward<Args>(args)...), fields);
}
template <typename... Args>
void error(const Fields& fields, fmt::format_string<Args...> format, Args&&... args) {
  write(Level::kError, fmt::format(format, std::forward<Args>(args)...), fields);
}

}  // namespace sightline::log
