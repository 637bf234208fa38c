// SPDX-License-Identifier: Apache-2.0
#include "system/wait_report.hpp"

#include <algorithm>

#include "sightline/base/log.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kLong = 5s;  // what a device needs to open, and a disk to spin up, is not news

Gauge& gauge_of(Registry& registry, const std::string& thread, const std::string& what) {
  return registry.gauge(
      "sightline_waiting_seconds",
      "How long a thread has been waiting for a device or a disk; 0: not any more",
      {{"thread", thread}, {"for", what}});
}

}  // namespace

void WaitReport::end(const std::string& thread, const Told& told, Time now) {
  gauge_of(registry_, thread, told.what).set(0);
  if (!told.logged) return;
  log::info("{}: waited {:.1f} s for {}, it goes on", thread, to_seconds(now - told.since),
            told.what);
}

void WaitReport::tell(const std::vector<ThreadWait>& waits, Time now) {
  for (auto it = told_.begin(); it != told_.end();) {
    const auto same = [&](const ThreadWait& wait) {
      return wait.thread == it->first && wait.since == it->second.since;
    };
    if (std::ranges::any_of(waits, same)) {
      ++it;
      continue;
    }
    end(it->first, it->second, now);
    it = told_.erase(it);
  }
  for (const ThreadWait& wait : waits) {
    Told& told = told_.try_emplace(wait.thread, Told{wait.what, wait.since}).first->second;
    gauge_of(registry_, wait.thread, wait.what).set(to_seconds(now - wait.since));
    if (told.logged || now - wait.since < kLong) continue;
    told.logged = true;
    log::warning("{} has waited {:.0f} s for {}; everything else goes on", wait.thread,
                 to_seconds(now - wait.since), wait.what);
  }
}

}  // namespace sightline
