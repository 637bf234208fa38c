// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "sightline/base/time.hpp"

namespace sightline {

/// What a host's clock is worth.
struct ClockState {
  Duration bound{0};  ///< UTC here is off by at most this
  bool fit = false;
  std::string text;  ///< "chrony", "as configured", or what is wrong
};

/// Bound on the error of the system clock from one line of `chronyc -c tracking`: offset, root
/// dispersion and half of the root delay (RFC 5905, 11.2). Nullopt: unreadable, or not in step with
/// any server.
std::optional<Duration> chrony_bound(std::string_view line);

/// Watches the offset of UTC to CLOCK_MONOTONIC. Both are slewed alike, so that only a step changes
/// it. Passive; one thread at a time.
class ClockWatch {
 public:
  ClockWatch(Duration configured_bound, Duration limit)
      : configured_bound_(configured_bound), limit_(limit) {}

  /// One reading of both clocks; `uncertainty`: of their being read at one time. True: a step.
  bool note(Time now, int64_t utc_ns, Duration uncertainty);
  /// What the time service says; nullopt: there is none, or `problem` says why it is of no use.
  void set_service(std::optional<Duration> bound, std::string problem);

  int64_t utc_ns_of(Time time) const { return to_ns(time) + offset_ns_.value_or(0); }
  Time time_of(int64_t utc_ns) const { return time_from_ns(utc_ns - offset_ns_.value_or(0)); }
  ClockState state(Time now) const;
  uint64_t steps() const { return steps_; }

  /// Not fit for this long after a step: it may not be the last.
  static constexpr Duration kAfterStep = std::chrono::seconds(5);
  static constexpr Duration kSmallestStep = std::chrono::microseconds(500);

 private:
  Duration configured_bound_, limit_;
  std::optional<int64_t> offset_ns_;
  std::optional<Duration> service_;
  std::string problem_;
  std::optional<Time> stepped_;
  uint64_t steps_ = 0;
};

}  // namespace sightline
