// SPDX-License-Identifier: Apache-2.0
#include "clock.hpp"

#include <cmath>
#include <ctime>

namespace sightline::gige {
namespace {

constexpr int64_t kTaiMinusUtcNs = 37'000'000'000;
constexpr int64_t kFirstReadingNs = 12'000'000'000;  // as if it was switched on 12 s ago

int64_t now_of(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

int64_t tai_minus_monotonic() {
  static const int64_t offset = now_of(CLOCK_REALTIME) + kTaiMinusUtcNs - now_of(CLOCK_MONOTONIC);
  return offset;
}

}  // namespace

int64_t host_now_ns() { return now_of(CLOCK_MONOTONIC); }

DeviceClock::DeviceClock(uint64_t tick_hz, double drift_ppm, int64_t now_ns)
    : tick_hz_(tick_hz),
      drift_(drift_ppm * 1e-6),
      anchor_host_ns_(now_ns),
      base_ns_(kFirstReadingNs) {}

int64_t DeviceClock::device_ns(int64_t host_ns) const {
  if (ptp_) return host_ns + tai_minus_monotonic();
  const int64_t passed = host_ns - anchor_host_ns_;
  return base_ns_ + passed + std::llround(static_cast<double>(passed) * drift_);
}

uint64_t DeviceClock::ticks(int64_t host_ns) const {
  const auto value = static_cast<unsigned __int128>(device_ns(host_ns)) * tick_hz_ / 1'000'000'000;
  const auto ticks = static_cast<uint64_t>(value);
  return wrap_ > 0 && !ptp_ ? ticks % wrap_ : ticks;
}

int64_t DeviceClock::host_ns_of(uint64_t ticks) const {
  const auto device =
      static_cast<int64_t>(static_cast<unsigned __int128>(ticks) * 1'000'000'000 / tick_hz_);
  if (ptp_) return device - tai_minus_monotonic();
  return anchor_host_ns_ + host_duration(device - base_ns_);
}

int64_t DeviceClock::host_duration(int64_t device_ns) const {
  const double rate = ptp_ ? 0 : drift_;
  return device_ns - std::llround(static_cast<double>(device_ns) * rate / (1 + rate));
}

void DeviceClock::set_drift(double ppm, int64_t now_ns) {
  const bool ptp = ptp_;
  ptp_ = false;
  base_ns_ = device_ns(now_ns);
  ptp_ = ptp;
  anchor_host_ns_ = now_ns;
  drift_ = ppm * 1e-6;
}

void DeviceClock::reset(int64_t now_ns) {
  anchor_host_ns_ = now_ns;
  base_ns_ = 0;
}

}  // namespace sightline::gige
