// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "sightline/base/time.hpp"

// What becomes of messages (log.hpp) that nobody reads.
namespace sightline::log {

/// From now on no message waits for whoever reads stderr: up to 256 KiB are kept, then the oldest
/// are lost, which is counted and said. Until then each message waits, and none is lost. Before
/// other threads log; once is enough.
void never_wait();
/// Writes what was kept, waiting at most so long for it to be read; true if nothing is left. To be
/// called now and then, and before the program ends. Any thread.
bool flush(Duration patience);
/// Messages lost since never_wait(). Any thread.
uint64_t lost();

}  // namespace sightline::log
