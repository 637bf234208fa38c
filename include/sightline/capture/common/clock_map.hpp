// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "sightline/base/time.hpp"

namespace sightline {

struct ClockMapOptions {
  Duration period = std::chrono::milliseconds(33);  ///< of the frames, roughly
  /// Shortest time from the stamped event to the arrival (exposure, read-out, wire), and how far
  /// the truth may be from it. Arrivals alone cannot tell: it goes into every bound.
  Duration transit{0};
  Duration transit_error{0};
  double max_rate_error = 500e-6;  ///< largest believable drift of the device clock
};

struct MappedTime {
  Time time{};
  Duration bound{0};  ///< |time - truth| stays below it in 99.9 % of the frames
};

/// Maps the clock of a device to CLOCK_MONOTONIC from pairs (device stamp, arrival on the host).
///
/// An arrival is late by the transit plus a jitter that is never negative, so the mapping follows
/// the *earliest* arrivals: the least delay in each second of the last 30, a line through these by
/// the median of all pairwise slopes (Theil and Sen), its offset by the median of their residuals.
/// The bound is the transit's error, the scatter of those minima about the line, what jitter they
/// may still hold, and the slope's uncertainty over the extrapolation.
///
/// One thread; nothing allocates.
class ClockMap {
 public:
  enum class Event {
    kTaken,
    kRejected,  ///< stamp 0, not later than the last, or more than a period in the future
    kReset,     ///< the device clock jumped, wrapped or began anew: the mapping begins again here
  };

  explicit ClockMap(const ClockMapOptions& options);

  /// One frame, in order of arrival. Stamps that are rejected several times running, but agree
  /// among themselves, are a new epoch of the device's clock: kReset.
  Event add(int64_t device_ns, Time arrival);

  /// Host time of a device stamp; nullopt before the first pair that was taken.
  std::optional<MappedTime> map(int64_t device_ns) const;

  /// Forgets everything (the source was opened again).
  void reset();

  /// Rate of the device clock against the host's, minus 1: +50e-6 means the device runs fast. 0
  /// until some seconds are known.
  double drift() const;
  /// Bound of a stamp that came just now.
  Duration bound() const;
  uint64_t rejected() const { return rejected_; }
  uint64_t resets() const { return resets_; }

 private:
  static constexpr size_t kBuckets = 30;
  static constexpr Duration kBucketSpan = std::chrono::seconds(1);

  /// The least delayed arrival of one second.
  struct Bucket {
    int64_t device_ns = 0;
    int64_t delay_ns = 0;  ///< arrival minus device stamp; the epochs differ, so any value
    Time started{};
    uint32_t samples = 0;
    double excess_sum_ns = 0;  ///< of the delays above the line, for the jitter's mean
  };

  bool fits(int64_t device_ns, Time arrival) const;
  bool candidate_agrees(int64_t device_ns, Time arrival) const;
  Event reject(int64_t device_ns, Time arrival);
  void restart(int64_t device_ns, Time arrival);
  void take(int64_t device_ns, Time arrival);
  void drop_old(Time now);
  void fit_rate();
  void fit_offset();
  double delay_at(int64_t device_ns) const;
  const Bucket& bucket(size_t i) const { return buckets_[(first_ + i) % kBuckets]; }
  Bucket& bucket(size_t i) { return buckets_[(first_ + i) % kBuckets]; }

  ClockMapOptions options_;
  std::array<Bucket, kBuckets> buckets_{};
  size_t first_ = 0, count_ = 0;
  int64_t last_device_ns_ = 0;
  uint32_t late_run_ = 0;  ///< frames running that came far behind the line
  Time late_since_{};
  // The line: delay = anchor_delay_ns_ + offset_ns_ + slope_ * (device - anchor_device_ns_).
  int64_t anchor_device_ns_ = 0, anchor_delay_ns_ = 0;
  double offset_ns_ = 0, slope_ = 0;
  double scatter_ns_ = 0, jitter_ns_ = 0, slope_error_ = 0;
  // Stamps that were rejected, in case they are a new epoch.
  int64_t candidate_device_ns_ = 0;
  Time candidate_arrival_{};
  uint32_t candidates_ = 0;
  uint64_t rejected_ = 0, resets_ = 0;
};

}  // namespace sightline
