// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/cpu.hpp"

#include <cstdlib>

namespace sightline {

bool cpu_has_avx2() {
#if defined(__x86_64__)
  static const bool has = std::getenv("SIGHTLINE_NO_AVX2") == nullptr &&
                          __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return has;
#else
  return false;
#endif
}

}  // namespace sightline
