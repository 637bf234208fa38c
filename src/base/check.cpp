// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/check.hpp"

#include <cstdio>
#include <cstdlib>

namespace sightline {

void check_failed(const char* condition, const char* file, int line, std::string_view message) {
  std::fprintf(stderr, "%s:%d: broken invariant '%s': %.*s\n", file, line, condition,
               static_cast<int>(message.size()), message.data());
  std::abort();
}

}  // namespace sightline
