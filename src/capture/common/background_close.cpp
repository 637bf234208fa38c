// SPDX-License-Identifier: Apache-2.0
#include "capture/common/background_close.hpp"

#include <system_error>
#include <utility>

#include "sightline/base/thread.hpp"

namespace sightline::capture {

BackgroundCloses& BackgroundCloses::of_process() {
  static auto* const closes = new BackgroundCloses();
  return *closes;
}

bool BackgroundCloses::run(const std::string& name, std::function<void()> close, Duration patience,
                           const std::function<void()>& hurry) {
  const auto done = std::make_shared<bool>(false);  // guarded by the mutex
  {
    std::lock_guard lock(shared_->mutex);
    ++shared_->pending[name];
  }
  // One for all copies of the body: what it holds goes when it has run, and in that thread.
  const auto work = std::make_shared<std::function<void()>>(std::move(close));
  const auto body = [shared = shared_, work, done, name](std::stop_token) {
    (*work)();
    *work = nullptr;
    std::lock_guard lock(shared->mutex);
    *done = true;
    if (--shared->pending[name] == 0) shared->pending.erase(name);
    shared->changed.notify_all();
  };
  try {
    start_thread(name + "-close", body).detach();
  } catch (const std::system_error&) {
    body({});  // no more threads: then here, however long it takes
  }
  std::unique_lock lock(shared_->mutex);
  const auto ended = [&] { return *done; };
  if (shared_->changed.wait_for(lock, patience, ended)) return true;
  lock.unlock();
  hurry();
  lock.lock();
  return shared_->changed.wait_for(lock, patience, ended);
}

size_t BackgroundCloses::pending(const std::string& name) const {
  std::lock_guard lock(shared_->mutex);
  const auto found = shared_->pending.find(name);
  return found == shared_->pending.end() ? 0 : found->second;
}

}  // namespace sightline::capture
