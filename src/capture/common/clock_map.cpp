// SPDX-License-Identifier: Apache-2.0
#include "sightline/capture/common/clock_map.hpp"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

constexpr uint32_t kAgreeing = 5;  // rejected stamps running that make a new epoch
constexpr uint32_t kLateFrames = 10;
constexpr Duration kLateSpan = std::chrono::seconds(3);
constexpr size_t kBucketsForRate = 5;
// 99.9 % of exponentially distributed jitters are below 6.9 times its mean.
constexpr double kJitterQuantile = 6.9;

double to_double(int64_t ns) { return static_cast<double>(ns); }

template <size_t N>
double median(std::array<double, N>& values, size_t count) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(count / 2);
  std::nth_element(values.begin(), middle, values.begin() + static_cast<ptrdiff_t>(count));
  return *middle;
}

}  // namespace

ClockMap::ClockMap(const ClockMapOptions& options) : options_(options) {}

void ClockMap::reset() {
  first_ = count_ = 0;
  last_device_ns_ = 0;
  late_run_ = candidates_ = 0;
  offset_ns_ = slope_ = scatter_ns_ = jitter_ns_ = slope_error_ = 0;
}

ClockMap::Event ClockMap::add(int64_t device_ns, Time arrival) {
  if (device_ns <= 0) {
    ++rejected_;
    return Event::kRejected;
  }
  drop_old(arrival);
  if (count_ == 0) {  // the first pair, or the first after a long silence
    restart(device_ns, arrival);
    return Event::kTaken;
  }
  if (!fits(device_ns, arrival)) return reject(device_ns, arrival);
  candidates_ = 0;
  const double late = to_double(to_ns(arrival) - device_ns - anchor_delay_ns_) -
                      delay_at(device_ns) - to_double(options_.period.count());
  if (late <= 0) {
    late_run_ = 0;
  } else {
    if (late_run_++ == 0) late_since_ = arrival;
    if (late_run_ >= kLateFrames && arrival - late_since_ >= kLateSpan) {
      ++resets_;
      restart(device_ns, arrival);
      return Event::kReset;
    }
  }
  take(device_ns, arrival);
  return Event::kTaken;
}

// Neither backwards nor, by the mapping so far, more than a period in the future.
bool ClockMap::fits(int64_t device_ns, Time arrival) const {
  if (device_ns <= last_device_ns_) return false;
  const double delay = to_double(to_ns(arrival) - device_ns - anchor_delay_ns_);
  return delay >= delay_at(device_ns) - to_double(options_.period.count());
}

bool ClockMap::candidate_agrees(int64_t device_ns, Time arrival) const {
  if (candidates_ == 0 || device_ns <= candidate_device_ns_) return false;
  const Duration difference =
      Duration(device_ns - candidate_device_ns_) - (arrival - candidate_arrival_);
  return std::chrono::abs(difference) < options_.period;
}

ClockMap::Event ClockMap::reject(int64_t device_ns, Time arrival) {
  candidates_ = candidate_agrees(device_ns, arrival) ? candidates_ + 1 : 1;
  candidate_device_ns_ = device_ns;
  candidate_arrival_ = arrival;
  if (candidates_ >= kAgreeing) {
    ++resets_;
    restart(device_ns, arrival);
    return Event::kReset;
  }
  ++rejected_;
  return Event::kRejected;
}

void ClockMap::restart(int64_t device_ns, Time arrival) {
  reset();
  take(device_ns, arrival);
}

void ClockMap::drop_old(Time now) {
  while (count_ > 0 && now - bucket(0).started > kBucketSpan * static_cast<int>(kBuckets)) {
    first_ = (first_ + 1) % kBuckets;
    --count_;
  }
}

void ClockMap::take(int64_t device_ns, Time arrival) {
  const int64_t delay = to_ns(arrival) - device_ns;
  const bool opens = count_ == 0 || arrival - bucket(count_ - 1).started >= kBucketSpan;
  if (opens) {
    if (count_ == kBuckets) {
      first_ = (first_ + 1) % kBuckets;
      --count_;
    }
    bucket(count_++) = Bucket{device_ns, delay, arrival, 0, 0};
    if (count_ == 1) anchor_device_ns_ = device_ns, anchor_delay_ns_ = delay;
  }
  Bucket& newest = bucket(count_ - 1);
  const double above = to_double(delay - anchor_delay_ns_) - delay_at(device_ns);
  newest.excess_sum_ns += std::max(above, 0.0);
  ++newest.samples;
  if (delay < newest.delay_ns) newest.device_ns = device_ns, newest.delay_ns = delay;
  last_device_ns_ = device_ns;
  if (opens) fit_rate();
  fit_offset();
}

double ClockMap::delay_at(int64_t device_ns) const {
  return offset_ns_ + slope_ * to_double(device_ns - anchor_device_ns_);
}

// Theil-Sen over pairs at least half a window apart: the near ones only add noise.
void ClockMap::fit_rate() {
  // The anchor follows the window, so that differences stay small enough for a double.
  anchor_device_ns_ = bucket(0).device_ns;
  anchor_delay_ns_ = bucket(0).delay_ns;
  slope_ = 0;
  if (count_ < kBucketsForRate) return;
  std::array<double, kBuckets * kBuckets / 2> slopes{};
  size_t pairs = 0;
  // The newest bucket has just been opened; its minimum is no minimum yet.
  const size_t full = count_ - 1;
  for (size_t i = 0; i + full / 2 < full; ++i) {
    for (size_t k = i + full / 2; k < full; ++k) {
      if (bucket(k).device_ns == bucket(i).device_ns) continue;
      slopes[pairs++] = to_double(bucket(k).delay_ns - bucket(i).delay_ns) /
                        to_double(bucket(k).device_ns - bucket(i).device_ns);
    }
  }
  if (pairs == 0) return;
  slope_ = std::clamp(median(slopes, pairs), -options_.max_rate_error, options_.max_rate_error);
}

void ClockMap::fit_offset() {
  std::array<double, kBuckets> residuals{};
  uint64_t samples = 0;
  double excess = 0;
  for (size_t i = 0; i < count_; ++i) {
    const Bucket& b = bucket(i);
    residuals[i] = to_double(b.delay_ns - anchor_delay_ns_) -
                   slope_ * to_double(b.device_ns - anchor_device_ns_);
    samples += b.samples;
    excess += b.excess_sum_ns;
  }
  // A second that has hardly begun has no minimum yet, unless it is below the others.
  std::array<double, kBuckets> sorted = residuals;
  size_t used = count_;
  if (count_ > 1 && bucket(count_ - 1).samples * 2 < bucket(count_ - 2).samples) --used;
  offset_ns_ = median(sorted, used);
  if (used == 2) offset_ns_ = std::min(residuals[0], residuals[1]);
  scatter_ns_ = 0;
  for (size_t i = 0; i < count_; ++i) {
    const double off = residuals[i] - offset_ns_;
    scatter_ns_ = std::max(scatter_ns_, i < used ? std::abs(off) : -off);
  }
  const double n = static_cast<double>(samples);
  jitter_ns_ = std::max(kJitterQuantile * excess / n * static_cast<double>(count_) / n,
                        to_double(options_.period.count()) / n);
  const double span = to_double(bucket(count_ - 1).device_ns - bucket(0).device_ns);
  slope_error_ = count_ < kBucketsForRate
                     ? options_.max_rate_error
                     : std::min(options_.max_rate_error, 2 * (scatter_ns_ + jitter_ns_) / span);
}

std::optional<MappedTime> ClockMap::map(int64_t device_ns) const {
  if (count_ == 0) return std::nullopt;
  const int64_t delay = anchor_delay_ns_ + std::llround(delay_at(device_ns));
  const int64_t center =
      bucket(0).device_ns + (bucket(count_ - 1).device_ns - bucket(0).device_ns) / 2;
  const double reach = std::abs(to_double(device_ns - center)) * slope_error_;
  MappedTime mapped;
  mapped.time = time_from_ns(device_ns + delay) - options_.transit;
  mapped.bound = options_.transit_error + Duration(std::llround(scatter_ns_ + jitter_ns_ + reach));
  return mapped;
}

double ClockMap::drift() const { return -slope_ / (1 + slope_); }

Duration ClockMap::bound() const {
  const auto mapped = map(last_device_ns_);
  return mapped ? mapped->bound : Duration{0};
}

}  // namespace sightline
