// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/thread.hpp"

#include <pthread.h>

#include <exception>
#include <utility>

#include "sightline/base/log.hpp"

namespace sightline {

void name_this_thread(const std::string& name) {
  pthread_setname_np(pthread_self(), name.substr(0, 15).c_str());
}

std::jthread start_thread(std::string name, std::function<void(std::stop_token)> body,
                          std::function<void(const std::string&)> on_failure) {
  return std::jthread([name = std::move(name), body = std::move(body),
                       on_failure = std::move(on_failure)](std::stop_token stop) {
    name_this_thread(name);
    std::string what;
    try {
      body(std::move(stop));
      return;
    } catch (const std::exception& exception) {
      what = exception.what();
    } catch (...) {
      what = "unknown exception";
    }
    log::error("thread {} ended by an exception: {}", name, what);
    if (on_failure) on_failure(name + ": " + what);
  });
}

}  // namespace sightline
