// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "sightline/base/executor.hpp"
#include "sightline/base/result.hpp"

namespace sightline {

/// On the calling thread and helpers, as many together as the machine has hardware threads. The one
/// exception to "threads live in daemon/": the helpers are joined before this returns, so that they
/// are seen by nobody and need no supervision.
void run_in_parallel(size_t count, const std::function<void(size_t)>& body);

/// One error of several, of which there is at least one: the first, with the messages of the
/// others, each once, in lines of their own.
Error join_errors(const std::vector<Error>& errors);

/// The errors of all that failed, in order (join_errors()). All are run in any case.
Status for_each_index(const Executor& executor, size_t count,
                      const std::function<Status(size_t)>& body);

}  // namespace sightline
