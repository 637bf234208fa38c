// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "sightline/base/time.hpp"

namespace sightline::capture {

/// Things of a library that is being asked to let go of them, each on a thread of its own
/// ("NAME-close"), because it may hang. Any thread.
class BackgroundCloses {
 public:
  /// Those of the process. Never destroyed: a thread that hangs may outlive everything else.
  static BackgroundCloses& of_process();

  /// Runs `close` and waits for it, for at most `patience`. If it takes longer `hurry` is called,
  /// which may make it end, and it is waited for once more. False: it goes on by itself.
  bool run(const std::string& name, std::function<void()> close, Duration patience,
           const std::function<void()>& hurry);
  /// How many of this name go on.
  size_t pending(const std::string& name) const;

 private:
  struct Shared {
    mutable std::mutex mutex;
    std::condition_variable changed;
    std::map<std::string, size_t> pending;
  };
  const std::shared_ptr<Shared> shared_ = std::make_shared<Shared>();  // with the threads
};

}  // namespace sightline::capture
