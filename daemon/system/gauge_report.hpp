// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "recording/recording_manager.hpp"
#include "sightline/base/counters.hpp"
#include "system/system.hpp"

namespace sightline {

/// Shows as metrics what nobody else says while it happens; call it about twice a second: how full
/// the queues between threads are, each at its worst since the last time (slots that hold the
/// newest alone are none: what they leave out is counted as dropped), and how well each object is
/// known and by which cameras.
void report_gauges(const System& system, const RecordingManager& recordings, Registry& registry);

}  // namespace sightline
