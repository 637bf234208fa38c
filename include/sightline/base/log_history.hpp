// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sightline/base/log.hpp"

// The newest messages (log.hpp), for who comes later: the page's list of events.
namespace sightline::log {

struct Event {
  uint64_t number = 0;  ///< 1 is the first that was kept
  int64_t utc_ns = 0;
  Level level = Level::kInfo;
  std::string text;  ///< the longest are cut
  std::string camera, object, cause;
};

/// From now on the newest `count` messages of kInfo and above are kept. Any thread; once.
void keep_history(size_t count);
/// Those that came after message `after`, oldest first. Any thread.
std::vector<Event> history(uint64_t after = 0);

}  // namespace sightline::log
