// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "sightline/base/counters.hpp"
#include "sightline/base/time.hpp"

namespace sightline {

/// How old a camera's frames are when a stage has done its part: "captured" (they have arrived),
/// "observed", "fused", "drawn", "encoded", "sent".
inline LatencyHistogram& stage_latency(Registry& registry, const std::string& camera,
                                       const char* stage) {
  return registry.histogram("sightline_latency_seconds",
                            "Age of frames, from the middle of their exposure, behind each stage",
                            {{"camera", camera}, {"stage", stage}});
}

inline void observe_age(LatencyHistogram& histogram, Time capture) {
  histogram.observe(to_seconds(MonotonicClock::now() - capture));
}

}  // namespace sightline
