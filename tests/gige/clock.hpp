// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <random>

namespace sightline::gige {

/// CLOCK_MONOTONIC, in nanoseconds.
int64_t host_now_ns();

/// The clock inside the simulated camera: it runs at its own rate, counts ticks, wraps, jumps and
/// is reset. With PTP it is the network's time (here: the host's TAI) and none of these.
class DeviceClock {
 public:
  DeviceClock(uint64_t tick_hz, double drift_ppm, int64_t now_ns);

  uint64_t tick_hz() const { return tick_hz_; }
  /// Ticks at an instant of the host's clock.
  uint64_t ticks(int64_t host_ns) const;
  /// The instant at which it shows (or showed) these ticks.
  int64_t host_ns_of(uint64_t ticks) const;
  /// Host time that passes while the device believes that `device_ns` do.
  int64_t host_duration(int64_t device_ns) const;

  void set_drift(double ppm, int64_t now_ns);
  void set_ptp(bool on) { ptp_ = on; }
  void set_wrap(uint64_t ticks) { wrap_ = ticks; }  ///< 0: never
  void jump(int64_t device_ns) { base_ns_ += device_ns; }
  void reset(int64_t now_ns);

 private:
  int64_t device_ns(int64_t host_ns) const;

  uint64_t tick_hz_;
  double drift_;  ///< 50e-6: gains 50 us each second
  int64_t anchor_host_ns_;
  int64_t base_ns_;  ///< what it showed at the anchor
  uint64_t wrap_ = 0;
  bool ptp_ = false;
};

}  // namespace sightline::gige
