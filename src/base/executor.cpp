// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/executor.hpp"

#include <exception>

namespace sightline {

void run_serially(size_t count, const std::function<void(size_t)>& body) {
  std::exception_ptr thrown;
  for (size_t i = 0; i < count; ++i) {
    try {
      body(i);
    } catch (...) {
      if (!thrown) thrown = std::current_exception();
    }
  }
  if (thrown) std::rethrow_exception(thrown);
}

}  // namespace sightline
