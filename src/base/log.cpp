// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/log.hpp"

#include <spdlog/details/os.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <string>

#include "base/journal.hpp"
#include "base/line_writer.hpp"
#include "base/log_keeper.hpp"
#include "sightline/base/log_output.hpp"

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

const char* pattern() { return under_journal() ? "%v" : "%H:%M:%S.%e %^%-7l%$ %v"; }

constexpr size_t kMostKept = size_t{256} << 10;  // [bytes] of what nobody reads

/// stderr through a LineWriter; spdlog's own sink for it waits while nobody reads a full pipe.
class PatientSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  PatientSink()
      : color_(spdlog::details::os::in_terminal(stderr) &&
               spdlog::details::os::is_color_terminal()),
        writer_(STDERR_FILENO, kMostKept, [this](uint64_t lost) { return note(lost); }) {}

  bool write_rest(Duration patience) {
    const std::lock_guard lock(mutex_);
    return writer_.flush(patience);
  }
  uint64_t lost() {
    const std::lock_guard lock(mutex_);
    return writer_.lost();
  }

 private:
  void sink_it_(const spdlog::details::log_msg& message) override {
    writer_.write(formatted(message));
  }
  void flush_() override {}

  std::string formatted(const spdlog::details::log_msg& message) {
    message.color_range_start = message.color_range_end = 0;
    spdlog::memory_buf_t buffer;
    formatter_->format(message, buffer);
    std::string line(buffer.data(), buffer.size());
    if (color_ && message.color_range_end > message.color_range_start) {
      line.insert(message.color_range_end, "\033[m");
      line.insert(message.color_range_start, color(message.level));
    }
    return line;
  }

  std::string note(uint64_t lost) {
    const std::string text = fmt::format("{}{} messages were lost: they were not read in time",
                                         under_journal() ? priority(Level::kWarning) : "", lost);
    return formatted(spdlog::details::log_msg("", spdlog::level::warn, text));
  }

  static const char* color(spdlog::level::level_enum level) {
    if (level >= spdlog::level::err) return "\033[31m\033[1m";
    if (level == spdlog::level::warn) return "\033[33m\033[1m";
    return level == spdlog::level::info ? "\033[32m" : "\033[36m";
  }

  const bool color_;
  base::LineWriter writer_;
};

// Null: writes wait. Never destroyed: threads may log until the very end.
std::atomic<PatientSink*> patient_sink{nullptr};

spdlog::logger& logger() {
  static spdlog::logger& instance = *[] {
    auto* made =
        new spdlog::logger("sightline", std::make_shared<spdlog::sinks::stderr_color_sink_mt>());
    made->set_pattern(pattern());
    made->set_level(spdlog::level::info);
    return made;
  }();
  return instance;
}

// The journal takes each line for a message of its own.
std::string with_priorities(Level level, std::string_view text) {
  std::string out = priority(level);
  for (const char c : text) {
    out += c;
    if (c == '\n') out += priority(level);
  }
  return out;
}

std::atomic<Level> current_level{Level::kInfo};

}  // namespace

void set_level(Level level) {
  current_level = level;
  logger().set_level(to_spdlog(level));
}

Level level() { return current_level; }

void write(Level line_level, std::string_view line, const Fields& fields) {
  if (!logger().should_log(to_spdlog(line_level))) return;
  base::keep_for_history(line_level, line, fields);
  static const auto journal = base::JournalSocket::open(STDERR_FILENO);
  // One that does not take it now may take the line, which is kept for it.
  if (journal && journal->send(base::journal_message(line_level, line, fields,
                                                     program_invocation_short_name))) {
    return;
  }
  if (under_journal()) {
    logger().log(to_spdlog(line_level), "{}", with_priorities(line_level, line));
  } else {
    logger().log(to_spdlog(line_level), "{}", line);
  }
}

void never_wait() {
  if (patient_sink != nullptr) return;
  base::reopen_without_blocking(STDERR_FILENO);
  const auto sink = std::make_shared<PatientSink>();
  sink->set_pattern(pattern());
  logger().sinks() = {sink};
  patient_sink = sink.get();
}

bool flush(Duration patience) {
  PatientSink* const sink = patient_sink;
  return sink == nullptr || sink->write_rest(patience);
}

uint64_t lost() {
  PatientSink* const sink = patient_sink;
  return sink == nullptr ? 0 : sink->lost();
}

}  // namespace sightline::log
