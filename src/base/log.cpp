// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/log.hpp"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <memory>

namespace sightline::log {
namespace {

spdlog::level::level_enum to_spdlog(Level level) {
  switch (level) {
    case Level::kDebug:
      return spdlog::level::debug;
    case Level::kInfo:
      return spdlog::level::info;
    case Level::kWarning:
      return spdlog::level::warn;
    case Level::kError:
      return spdlog::level::err;
  }
  return spdlog::level::err;
}

// Under systemd the journal adds time and program itself and reads "<N>" as the priority.
bool under_journal() {
  static const bool journal = std::getenv("JOURNAL_STREAM") != nullptr;
  return journal;
}

const char* priority(Level level) {
  switch (level) {
    case Level::kDebug:
      return "<7>";
    case Level::kInfo:
      return "<6>";
    case Level::kWarning:
      return "<4>";
    case Level::kError:
      return "<3>";
  }
  return "<3>";
}

spdlog::logger& logger() {
  // Never destroyed: threads may log until the very end.
  static spdlog::logger& instance = *[] {
    auto* made =
        new spdlog::logger("sightline", std::make_shared<spdlog::sinks::stderr_color_sink_mt>());
    made->set_pattern(under_journal() ? "%v" : "%H:%M:%S.%e %^%-7l%$ %v");
    made->set_level(spdlog::level::info);
    return made;
  }();
  return instance;
}

std::atomic<Level> current_level{Level::kInfo};

}  // namespace

void set_level(Level level) {
  current_level = level;
  logger().set_level(to_spdlog(level));
}

Level level() { return current_level; }

void write(Level line_level, std::string_view line) {
  if (under_journal()) {
    logger().log(to_spdlog(line_level), "{}{}", priority(line_level), line);
  } else {
    logger().log(to_spdlog(line_level), "{}", line);
  }
}

}  // namespace sightline::log
