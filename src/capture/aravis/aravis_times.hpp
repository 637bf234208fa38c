// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "capture/aravis/aravis_configure.hpp"
#include "capture/aravis/latch_map.hpp"
#include "sightline/capture/common/clock_map.hpp"
#include "sightline/model/frame.hpp"

namespace sightline::capture {

/// What one frame's stamps are.
struct FrameStamps {
  int64_t device_ns = 0;
  Time first_packet{};                ///< when it reached the host
  Time arrival{};                     ///< when the frame was complete
  std::optional<double> exposure_us;  ///< of this frame, where the camera says so
};

/// Middle of exposure of an Aravis camera's frames.
///
/// One-way stamps leave open how long it takes from the stamp to the first packet. A camera can
/// send at the earliest when it stamps, and usually does after exposure and up to a read-out later;
/// unless the user measured it, the exposure time is assumed and the bound covers the rest. With
/// latches of the camera's clock nothing of this is needed.
class AravisTimes {
 public:
  AravisTimes(const AravisOptions& options, const AravisSettings& settings);

  /// Fills device time, capture, its bound and the arrival.
  void stamp(const FrameStamps& stamps, FrameInfo& info);

  /// The camera's clock follows the network's.
  void set_tai(bool tai) { label_ = tai ? ClockLabel::kTai : ClockLabel::kDevice; }
  /// The camera's clock was read.
  void add(const Latch& latch) { latches_.add(latch); }

  const ClockMap& clock() const { return clock_; }
  bool latched() const { return latched_; }  ///< the newest stamp was mapped by latches
  double drift() const { return latched_ ? latches_.drift() : clock_.drift(); }
  Duration bound() const { return bound_; }  ///< of the newest stamp's mapping

 private:
  std::optional<MappedTime> map(const FrameStamps& stamps, ClockMap::Event event);

  Duration half_exposure_;   ///< half of what is set
  bool at_end_;              ///< the stamp is
  Duration exposure_error_;  ///< of automatic exposure, on the middle
  Duration transit_, transit_error_;
  Duration period_;
  ClockLabel label_ = ClockLabel::kDevice;
  ClockMap clock_;
  LatchMap latches_;
  bool latched_ = false;
  Duration bound_{0};
};

}  // namespace sightline::capture
