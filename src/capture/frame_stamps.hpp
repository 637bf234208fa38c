// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "sightline/base/time.hpp"

namespace sightline {

/// Makes 64-bit frame numbers of a driver's 32-bit ones and finds the gaps. A number that stands
/// still or goes back (drivers without numbers, camera reset) counts as the next frame.
class SequenceUnwrapper {
 public:
  struct Step {
    uint64_t sequence = 0;        ///< starts at 0
    uint32_t dropped_before = 0;  ///< frames between the previous step and this one
  };
  Step step(uint32_t sequence);

 private:
  std::optional<uint32_t> last_;
  uint64_t unwrapped_ = 0;
};

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

}  // namespace sightline
