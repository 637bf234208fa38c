// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>

namespace sightline {

/// Calls body(0) .. body(count - 1), in any order and on any threads, and returns when all of them
/// have returned. What one of them throws is thrown after that.
using Executor = std::function<void(size_t count, const std::function<void(size_t)>& body)>;

/// One after the other, on the calling thread.
void run_serially(size_t count, const std::function<void(size_t)>& body);

}  // namespace sightline
