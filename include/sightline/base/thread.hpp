// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <stop_token>
#include <string>
#include <thread>

namespace sightline {

/// Names the calling thread (15 bytes are kept; visible in `top -H`, gdb and core dumps).
void name_this_thread(const std::string& name);

/// Starts a named thread with one owner and a stop token. An exception that leaves `body` is
/// logged with the name and handed to `on_failure` (which may be empty); the thread then ends.
std::jthread start_thread(std::string name, std::function<void(std::stop_token)> body,
                          std::function<void(const std::string& what)> on_failure = {});

}  // namespace sightline
