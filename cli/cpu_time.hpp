// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ctime>

namespace sightline::cli {

/// CPU time of the process, all threads [ms].
inline double cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

}  // namespace sightline::cli
