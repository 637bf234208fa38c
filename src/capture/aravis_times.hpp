// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "aravis_configure.hpp"
#include "sightline/capture/clock_map.hpp"
#include "sightline/model/frame.hpp"

namespace sightline {

/// What one frame's stamps are.
struct FrameStamps {
  int64_t device_ns = 0;
  Time first_packet{};  ///< when it reached the host
  Time arrival{};       ///< when the frame was complete
};

/// Middle of exposure of an Aravis camera's frames.
///
/// One-way stamps leave open how long the way from the stamp to the first packet is. A camera can
/// send at the earliest when it stamps, and usually does after exposure and up to a read-out later;
/// unless the user measured it, the exposure time is assumed and the bound covers the rest.
class AravisTimes {
 public:
  AravisTimes(const AravisOptions& options, const AravisSettings& settings);

  /// Fills device time, capture, its bound and the arrival.
  void stamp(const FrameStamps& stamps, FrameInfo& info);

  const ClockMap& clock() const { return clock_; }

 private:
  Duration half_exposure_;   ///< from the stamp to the middle; negative for a stamp at the end
  Duration exposure_error_;  ///< of automatic exposure, on the middle
  Duration transit_, transit_error_;
  Duration period_;
  ClockLabel label_;
  ClockMap clock_;
};

}  // namespace sightline
