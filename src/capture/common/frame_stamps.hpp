// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "sightline/base/time.hpp"

namespace sightline::capture {

/// What a driver's time stamp marks.
enum class StampPoint { kStartOfExposure, kEndOfFrame };

struct CaptureTime {
  Time capture{};
  Duration error{0};
  bool stamp_rejected = false;  ///< capture is the arrival time
};

/// From a stamp of CLOCK_MONOTONIC to the middle of the exposure, as an interval: the stamp marks
/// one end, exposure and readout take somewhere between nothing and a frame period each unless
/// known. The estimate is the middle of the interval, the error half its width (and at least the
/// half millisecond by which drivers' stamps jitter).
///   start of exposure: [stamp, stamp + period/2], or stamp + exposure/2 when that is known
///   end of frame:      [stamp - 3/2 period, stamp], or [stamp - period, stamp] - exposure/2
class StampMapper {
 public:
  /// `period` is zero when unknown (then 33 ms are assumed), `exposure` is nullopt when the camera
  /// chooses it.
  StampMapper(StampPoint point, Duration period, std::optional<Duration> exposure);

  /// Stamps that are missing, zero, do not grow, lie more than a period in the future or ten
  /// seconds in the past are replaced by the arrival time, with the bound of two periods.
  CaptureTime map(std::optional<Time> stamp, Time arrival);
  void set_point(StampPoint point) { point_ = point; }
  void set_exposure(std::optional<Duration> exposure) { exposure_ = exposure; }

 private:
  bool plausible(Time stamp, Time arrival) const;

  StampPoint point_;
  Duration period_;
  std::optional<Duration> exposure_;
  std::optional<Time> last_;
};

}  // namespace sightline::capture
