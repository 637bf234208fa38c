// SPDX-License-Identifier: Apache-2.0
#include "control_thread.hpp"

#include <signal.h>
#include <unistd.h>

#include <exception>
#include <functional>
#include <utility>

#include "sightline/base/log.hpp"
#include "sightline/base/thread.hpp"

namespace sightline {
namespace {

Result<std::unique_ptr<Daemon>> start_daemon(const std::filesystem::path& file,
                                             std::function<void()> request_orders,
                                             const std::stop_token& stop) {
  try {
    SL_ASSIGN(Installation installation, read_installation(file));
    DaemonOptions options;
    // As `systemctl reload` does, so that the service manager is told of it in the same way.
    options.request_reload = [] { (void)::kill(::getpid(), SIGHUP); };
    options.request_orders = std::move(request_orders);
    return Daemon::start(std::move(installation), options, stop);
  } catch (const std::exception& exception) {
    return make_error(ErrorCode::kInternal, file.string(), "unexpected: {}", exception.what());
  }
}

}  // namespace

ControlThread::ControlThread(std::filesystem::path file) : file_(std::move(file)) {
  thread_ = start_thread("control", [this](std::stop_token stop) { run(stop); });
}

void ControlThread::request_reload() {
  std::lock_guard lock(mutex_);
  reload_ = true;
  changed_.notify_all();
}

void ControlThread::request_orders() {
  const std::lock_guard lock(mutex_);
  orders_ = true;
  changed_.notify_all();
}

bool ControlThread::busy() const {
  std::lock_guard lock(mutex_);
  return working_ || reload_;
}

std::shared_ptr<Daemon> ControlThread::daemon() const {
  std::lock_guard lock(mutex_);
  return daemon_;
}

std::optional<Error> ControlThread::failure() const {
  std::lock_guard lock(mutex_);
  return failure_;
}

void ControlThread::start(const std::stop_token& stop) {
  auto started = start_daemon(
      file_, [this] { request_orders(); }, stop);
  std::lock_guard lock(mutex_);
  started_ = true;
  if (started) {
    daemon_ = *std::move(started);
  } else {
    failure_ = std::move(started).error();
  }
}

void ControlThread::run(const std::stop_token& stop) {
  start(stop);
  std::unique_lock lock(mutex_);
  for (;;) {
    working_ = false;
    changed_.notify_all();
    changed_.wait(lock, stop, [this] { return reload_ || orders_; });
    if (stop.stop_requested() || !daemon_) break;
    const bool reload = std::exchange(reload_, false);
    orders_ = false;
    working_ = reload;
    const auto daemon = daemon_;
    lock.unlock();
    const Status done = reload ? daemon->reload(file_, stop) : Status();
    if (!done) {
      log::error("reload refused, everything goes on as before: {}", done.error().message());
    }
    daemon->do_orders(stop);
    lock.lock();
  }
  ended_ = true;
  changed_.notify_all();
}

// On a thread of its own: the other may be in the middle of a reload.
void ControlThread::stop_daemon() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return started_; });
  const auto daemon = daemon_;
  lock.unlock();
  StopLeft left;
  Status result = daemon ? daemon->stop(&left) : Status();
  lock.lock();
  result_ = std::move(result);
  left_ = std::move(left);
  stopped_ = true;
  changed_.notify_all();
}

bool ControlThread::stop(Duration patience) {
  const Time end = MonotonicClock::now() + patience;
  thread_.request_stop();
  stopper_ = start_thread("stop", [this](std::stop_token) { stop_daemon(); });
  std::unique_lock lock(mutex_);
  const bool done =
      changed_.wait_for(lock, end - MonotonicClock::now(), [this] { return ended_ && stopped_; });
  return done && left_.what.empty();
}

StopLeft ControlThread::left() const {
  std::lock_guard lock(mutex_);
  return left_;
}

bool ControlThread::stopped() const {
  std::lock_guard lock(mutex_);
  return stopped_ || !started_;
}

Status ControlThread::result() const {
  std::lock_guard lock(mutex_);
  return result_;
}

}  // namespace sightline
