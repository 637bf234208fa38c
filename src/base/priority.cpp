// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/priority.hpp"

#include <sys/resource.h>

#include <algorithm>

namespace sightline {

void give_way(int nice) {
  // On Linux of this thread alone.
  constexpr int kMost = 19;
  (void)setpriority(PRIO_PROCESS, 0, std::min(kMost, getpriority(PRIO_PROCESS, 0) + nice));
}

}  // namespace sightline
