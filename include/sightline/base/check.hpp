// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace sightline {

/// Prints the failed condition with its place and aborts. For broken invariants (our bugs), never
/// for input: input errors are a Result.
[[noreturn]] void check_failed(const char* condition, const char* file, int line,
                               std::string_view message);

}  // namespace sightline

/// Always-on check of an invariant.
#define SL_CHECK(condition, message)                                        \
  do {                                                                      \
    if (!(condition)) [[unlikely]]                                          \
      ::sightline::check_failed(#condition, __FILE__, __LINE__, (message)); \
  } while (false)
