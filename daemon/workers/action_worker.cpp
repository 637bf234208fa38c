// SPDX-License-Identifier: Apache-2.0
#include "workers/action_worker.hpp"

#include <condition_variable>
#include <mutex>

#include "sightline/base/log.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

constexpr Duration kStallLimit = 5s;
constexpr Duration kTurn = 200ms;

void wait_until(std::stop_token stop, Time time) {
  std::mutex mutex;
  std::condition_variable_any never;
  std::unique_lock lock(mutex);
  never.wait_for(lock, stop, time - MonotonicClock::now(), [] { return false; });
}

void fire_at_rate(std::stop_token stop, const ActionConfig& config, Counter& sent,
                  Heartbeat& heartbeat) {
  const Duration period = from_seconds(1 / config.rate_hz);
  Time next = MonotonicClock::now();
  std::string problem;
  while (!stop.stop_requested()) {
    heartbeat.beat();
    const Time now = MonotonicClock::now();
    if (now < next) {
      wait_until(stop, std::min(next, now + kTurn));
      continue;
    }
    // After a pause it goes on; it does not make up for what was missed.
    next = now - next < period ? next + period : now + period;
    const Status fired = fire_gige_action(config.command);
    if (fired) sent.add();
    const std::string words = fired ? "" : fired.error().message();
    if (words != problem && !words.empty()) log::warning("action: {}", words);
    problem = words;
  }
}

}  // namespace

std::unique_ptr<ActionWorker> ActionWorker::start(const ActionConfig& config, Registry& registry,
                                                  HeartbeatBoard& beats) {
  if (config.rate_hz <= 0) return nullptr;
  std::unique_ptr<ActionWorker> worker(new ActionWorker);
  Counter& sent = registry.counter("sightline_actions_total", "Action commands sent to cameras");
  worker->thread_ = start_watched_thread(beats, "action", kStallLimit,
                                         [config, &sent](std::stop_token stop, Heartbeat& beat) {
                                           fire_at_rate(stop, config, sent, beat);
                                         });
  return worker;
}

}  // namespace sightline
