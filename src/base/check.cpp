// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/check.hpp"

#include <cstdio>
#include <cstdlib>

#include "sightline/base/log_output.hpp"

namespace sightline {

void check_failed(const char* condition, const char* file, int line, std::string_view message) {
  (void)log::flush(std::chrono::milliseconds(200));  // what led to it
  std::fprintf(stderr, "%s:%d: broken invariant '%s': %.*s\n", file, line, condition,
               static_cast<int>(message.size()), message.data());
  std::abort();
}

}  // namespace sightline
