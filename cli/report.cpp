// SPDX-License-Identifier: Apache-2.0
#include "report.hpp"

#include <cstdio>

namespace sightline::cli {

int report(const Error& error) {
  std::fprintf(stderr, "sightline: %s\n", error.message().c_str());
  return exit_code(error);
}

}  // namespace sightline::cli
