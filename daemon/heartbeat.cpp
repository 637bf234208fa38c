// SPDX-License-Identifier: Apache-2.0
#include "heartbeat.hpp"

#include <algorithm>

#include "sightline/base/thread.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kLook = 20ms;  // between looks at what a thread does that does not end

class EndOfBody {
 public:
  explicit EndOfBody(Heartbeat& beat) : beat_(beat), listening_(beat) {}
  ~EndOfBody() { beat_.end(); }
  EndOfBody(const EndOfBody&) = delete;
  EndOfBody& operator=(const EndOfBody&) = delete;

 private:
  Heartbeat& beat_;
  const WaitListening listening_;
};

}  // namespace

void Heartbeat::wait_begins(const char* what) {
  waiting_since_.store(MonotonicClock::now(), std::memory_order_relaxed);
  waits_for_.store(what, std::memory_order_release);
}

// Whoever sees that it waits no more sees this beat, too.
void Heartbeat::wait_ends() {
  beat();
  waits_for_.store(nullptr, std::memory_order_release);
}

bool Heartbeat::stalled(Time now) const {
  if (retired() || waits_for_.load(std::memory_order_acquire) != nullptr) return false;
  return now - last_.load(std::memory_order_relaxed) > limit_;
}

std::optional<Heartbeat::Wait> Heartbeat::wait() const {
  const char* const what = waits_for_.load(std::memory_order_acquire);
  if (what == nullptr) return std::nullopt;
  return Wait{what, waiting_since_.load(std::memory_order_relaxed)};
}

void Heartbeat::end() {
  std::lock_guard lock(mutex_);
  ended_ = true;
  ended_changed_.notify_all();
}

bool Heartbeat::wait_for_end(Duration patience) const {
  std::unique_lock lock(mutex_);
  return ended_changed_.wait_for(lock, patience, [this] { return ended_; });
}

std::shared_ptr<Heartbeat> HeartbeatBoard::add(std::string name, Duration limit) {
  auto beat = std::make_shared<Heartbeat>(std::move(name), limit);
  std::lock_guard lock(mutex_);
  std::erase_if(beats_, [](const auto& old) { return old->retired(); });
  beats_.push_back(beat);
  return beat;
}

std::vector<std::string> HeartbeatBoard::stalled(Time now) const {
  std::lock_guard lock(mutex_);
  std::vector<std::string> names;
  for (const auto& beat : beats_) {
    if (beat->stalled(now)) names.push_back(beat->name());
  }
  return names;
}

std::vector<ThreadWait> HeartbeatBoard::waits(Time now, Duration least) const {
  std::lock_guard lock(mutex_);
  std::vector<ThreadWait> all;
  for (const auto& beat : beats_) {
    const auto wait = beat->wait();
    if (wait && now - wait->since >= least) all.push_back({beat->name(), wait->what, wait->since});
  }
  return all;
}

size_t HeartbeatBoard::size() const {
  std::lock_guard lock(mutex_);
  return static_cast<size_t>(std::count_if(beats_.begin(), beats_.end(),
                                           [](const auto& beat) { return !beat->retired(); }));
}

WatchedThread::WatchedThread(HeartbeatBoard& beats, const std::string& name, Duration limit,
                             std::function<void(std::stop_token, Heartbeat&)> body)
    : beat_(beats.add(name, limit)) {
  try {
    thread_ = start_thread(name, [beat = beat_, body = std::move(body)](std::stop_token stop) {
      const EndOfBody end(*beat);
      body(std::move(stop), *beat);
      beat->retire();
    });
  } catch (...) {
    beat_->retire();  // there is no thread to wait for
    throw;
  }
}

bool WatchedThread::join_unless_waiting(Duration patience) {
  const Time end = MonotonicClock::now() + patience;
  while (!beat_->wait_for_end(kLook)) {
    if (MonotonicClock::now() >= end && beat_->wait()) return false;
  }
  thread_.join();
  return true;
}

std::jthread start_watched_thread(HeartbeatBoard& beats, const std::string& name, Duration limit,
                                  std::function<void(std::stop_token, Heartbeat&)> body) {
  return WatchedThread(beats, name, limit, std::move(body)).release();
}

}  // namespace sightline
