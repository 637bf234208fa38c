// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/log_history.hpp"

#include <atomic>
#include <chrono>
#include <deque>
#include <mutex>

#include "base/log_keeper.hpp"

namespace sightline {
namespace {

constexpr size_t kLongest = 600;  // [bytes]

struct Kept {
  std::mutex mutex;
  std::deque<log::Event> events;
  uint64_t last = 0;
};

std::atomic<size_t> most_kept{0};

// Never destroyed: threads may log until the very end.
Kept& kept() {
  static Kept& instance = *new Kept;
  return instance;
}

std::string shortened(std::string_view text) {
  if (text.size() <= kLongest) return std::string(text);
  size_t end = kLongest;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;  // UTF-8
  return std::string(text.substr(0, end)) + "...";
}

}  // namespace

void base::keep_for_history(log::Level level, std::string_view line, const log::Fields& fields) {
  const size_t most = most_kept;
  if (most == 0 || level < log::Level::kInfo) return;
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  log::Event event{0,
                   std::chrono::duration_cast<std::chrono::nanoseconds>(now).count(),
                   level,
                   shortened(line),
                   std::string(fields.camera),
                   std::string(fields.object),
                   std::string(fields.cause)};
  Kept& all = kept();
  const std::lock_guard lock(all.mutex);
  event.number = ++all.last;
  all.events.push_back(std::move(event));
  while (all.events.size() > most) all.events.pop_front();
}

void log::keep_history(size_t count) { most_kept = count; }

std::vector<log::Event> log::history(uint64_t after) {
  Kept& all = kept();
  const std::lock_guard lock(all.mutex);
  std::vector<Event> found;
  for (const Event& event : all.events) {
    if (event.number > after) found.push_back(event);
  }
  return found;
}

}  // namespace sightline
