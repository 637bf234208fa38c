// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

#include "heartbeat.hpp"
#include "sightline/base/counters.hpp"

namespace sightline {

/// Tells of threads that wait for a device or a disk: in the log once when it takes long and once
/// when it is over, and as metrics. One thread.
class WaitReport {
 public:
  explicit WaitReport(Registry& registry) : registry_(registry) {}
  /// `waits`: all there are now.
  void tell(const std::vector<ThreadWait>& waits, Time now);

 private:
  struct Told {
    std::string what;
    Time since{};
    bool logged = false;
  };
  void end(const std::string& thread, const Told& told, Time now);

  Registry& registry_;
  std::map<std::string, Told> told_;  // by thread
};

}  // namespace sightline
