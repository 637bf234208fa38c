// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/base/counters.hpp"

namespace sightline {

/// What one camera gave and what was lost, by cause. Lives as long as the camera's name, over all
/// reopenings of its source; any thread may read.
struct CaptureCounters {
  Counter good;            ///< frames delivered
  Counter damaged;         ///< dropped: error flag, short, or compressed data that does not decode
  Counter lost;            ///< missing in the device's sequence numbers, damaged ones included
  Counter copied;          ///< delivered as a copy, because readers held too many driver buffers
  Counter stamp_rejected;  ///< the device's time was impossible; the arrival time was used
  Counter starved;         ///< the device had no buffer to write into
};

}  // namespace sightline
