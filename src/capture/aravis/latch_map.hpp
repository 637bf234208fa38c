// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "sightline/capture/common/clock_map.hpp"

namespace sightline::capture {

/// The device noted its time (a latch) somewhere between these two instants of the host.
struct Latch {
  int64_t device_ns = 0;
  Time sent{}, answered{};
};

/// Maps the clock of a device to CLOCK_MONOTONIC from latches, which bound the offset from both
/// sides: unlike one-way stamps they leave no unknown delay.
///
/// A line through the middles of the latches of the last half minute: slope by the median of
/// pairwise slopes (Theil and Sen), offset by the median. At each latch the truth is within half
/// its width of its middle; the bound follows from the latch that makes it smallest, the slope's
/// uncertainty over the distance to it, and the scatter of the latches (a clock that is read with
/// jitter).
///
/// One thread; nothing allocates.
class LatchMap {
 public:
  /// In order. A latch that contradicts the ones before (clock set, wrapped, reset) begins anew.
  void add(const Latch& latch);
  void reset() { count_ = 0; }
  bool empty() const { return count_ == 0; }

  /// Host time of a device stamp, with a bound that holds in 99.9 % of stamps; nullopt while empty.
  std::optional<MappedTime> map(int64_t device_ns) const;
  /// Rate of the device clock against the host's, minus 1; 0 until some seconds are known.
  double drift() const { return -slope_ / (1 + slope_); }

 private:
  static constexpr size_t kKept = 32;

  struct Sample {
    int64_t device_ns = 0;
    int64_t offset_ns = 0;  ///< host minus device, at the middle
    int64_t half_ns = 0;    ///< of the width
    bool good = true;       ///< narrow enough for the line
  };

  bool contradicts(const Sample& sample) const;
  void choose_good();
  void fit();
  double slope_error(double deviation) const;
  double residual_of(const Sample& sample) const;
  double line_at(int64_t device_ns) const;  ///< offset less that of the anchor
  const Sample& sample(size_t i) const { return samples_[(first_ + i) % kKept]; }
  Sample& sample(size_t i) { return samples_[(first_ + i) % kKept]; }

  std::array<Sample, kKept> samples_{};
  size_t first_ = 0, count_ = 0;
  int64_t anchor_device_ns_ = 0, anchor_offset_ns_ = 0;
  double offset_ns_ = 0, slope_ = 0, slope_error_ = 0, scatter_ns_ = 0;
};

}  // namespace sightline::capture
