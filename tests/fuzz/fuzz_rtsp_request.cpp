// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "stream/request_guard.hpp"

/// What an RTSP client sends, at once and byte by byte: the same judgment, and never more than the
/// bounds without one.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using sightline::stream::RequestGuard;
  const sightline::Time now = sightline::time_from_ns(1);
  RequestGuard whole, bytewise;
  const auto at_once = whole.take({data, size}, now);
  auto verdict = RequestGuard::Verdict::kPass;
  size_t unfinished = 0;
  for (size_t i = 0; i < size && verdict == RequestGuard::Verdict::kPass; ++i) {
    verdict = bytewise.take({data + i, 1}, now);
    unfinished = bytewise.unfinished_since() == sightline::Time{} ? 0 : unfinished + 1;
    if (unfinished > 2 * 65536) std::abort();
  }
  if (verdict != at_once || whole.requests() != bytewise.requests()) std::abort();
  return 0;
}
