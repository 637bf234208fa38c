// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/parallel.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace sightline {
namespace {

// Indices are handed out one by one, so that a long one holds up nobody.
class SharedLoop {
 public:
  SharedLoop(size_t count, const std::function<void(size_t)>& body) : count_(count), body_(body) {}

  void take_part() {
    for (size_t i = next_++; i < count_; i = next_++) {
      try {
        body_(i);
      } catch (...) {
        std::lock_guard lock(mutex_);
        if (!thrown_) thrown_ = std::current_exception();
      }
    }
  }
  void rethrow() const {
    if (thrown_) std::rethrow_exception(thrown_);
  }

 private:
  const size_t count_;
  const std::function<void(size_t)>& body_;
  std::atomic<size_t> next_{0};
  std::mutex mutex_;  // guards thrown_ until the helpers are joined
  std::exception_ptr thrown_;
};

void run_on_threads(size_t most, size_t count, const std::function<void(size_t)>& body) {
  SharedLoop loop(count, body);
  std::vector<std::jthread> helpers;
  for (size_t i = 1; i < std::min(count, most); ++i) {
    try {
      helpers.emplace_back([&loop] { loop.take_part(); });  // named as the thread that starts it
    } catch (const std::system_error&) {
      break;  // no more threads to be had: those that are there do it all
    }
  }
  loop.take_part();
  helpers.clear();
  loop.rethrow();
}

}  // namespace

void run_in_parallel(size_t count, const std::function<void(size_t)>& body) {
  run_on_threads(std::max(1u, std::thread::hardware_concurrency()), count, body);
}

Error join_errors(const std::vector<Error>& errors) {
  SL_CHECK(!errors.empty(), "no error to join");
  Error joined = errors.front();
  std::vector<std::string> said{joined.message()};
  for (const Error& error : errors) {
    std::string message = error.message();
    if (std::find(said.begin(), said.end(), message) != said.end()) continue;
    joined.text += "\n" + message;
    said.push_back(std::move(message));
  }
  return joined;
}

Status for_each_index(const Executor& executor, size_t count,
                      const std::function<Status(size_t)>& body) {
  std::vector<Status> done(count);
  executor(count, [&](size_t i) { done[i] = body(i); });
  std::vector<Error> errors;
  for (Status& each : done) {
    if (!each) errors.push_back(std::move(each).error());
  }
  return errors.empty() ? Status() : join_errors(errors);
}

}  // namespace sightline
