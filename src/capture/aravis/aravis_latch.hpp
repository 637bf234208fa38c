// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "capture/aravis/aravis_ref.hpp"
#include "capture/aravis/latch_map.hpp"

namespace sightline::capture {

/// Asks a camera for the time on its own clock.
class AravisLatch {
 public:
  /// nullopt: it has none, or one in a unit that is not known.
  static std::optional<AravisLatch> find(ArvCamera* camera);

  /// Takes two or three round trips to the camera, and seconds if it does not answer.
  std::optional<Latch> take(ArvCamera* camera) const;

 private:
  const char* command_ = nullptr;
  const char* value_ = nullptr;
  uint64_t ticks_per_second_ = 1'000'000'000;
};

}  // namespace sightline::capture
