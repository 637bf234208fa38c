// SPDX-License-Identifier: Apache-2.0
#include "sightline/capture/common/camera_sync.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace sightline {
namespace {

constexpr size_t kMinPairs = 5;
constexpr size_t kMaxForSlopes = 400;  // pairs of pairs grow with the square

double quantile(std::vector<double> values, double share) {
  const double at = share * static_cast<double>(values.size() - 1);
  const auto nth = values.begin() + static_cast<ptrdiff_t>(at);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

double median(std::vector<double> values) { return quantile(std::move(values), 0.5); }

// Seconds; 0: too few frames. The median, since frames may be missing.
double period_of(std::span<const SyncStamp> stamps) {
  if (stamps.size() < 3) return 0;
  std::vector<double> steps;
  for (size_t i = 1; i < stamps.size(); ++i) {
    steps.push_back(to_seconds(stamps[i].time - stamps[i - 1].time));
  }
  return median(std::move(steps));
}

struct Difference {
  double t = 0;      ///< of the frame of A, since its first
  double later = 0;  ///< of B
  double error = 0;
};

std::vector<Difference> pair_up(std::span<const SyncStamp> a, std::span<const SyncStamp> b,
                                double period) {
  std::vector<Difference> differences;
  size_t next = 0;
  for (const SyncStamp& stamp : a) {
    while (next + 1 < b.size() && std::chrono::abs(b[next + 1].time - stamp.time) <=
                                      std::chrono::abs(b[next].time - stamp.time)) {
      ++next;
    }
    const double later = to_seconds(b[next].time - stamp.time);
    if (std::abs(later) > period) continue;  // one of them was not there
    differences.push_back(
        {to_seconds(stamp.time - a.front().time), later, to_seconds(stamp.error + b[next].error)});
  }
  // The phase may run out of one end of the period and in at the other.
  for (size_t i = 1; i < differences.size(); ++i) {
    const double step = differences[i].later - differences[i - 1].later;
    differences[i].later -= period * std::round(step / period);
  }
  return differences;
}

double slope_of(const std::vector<Difference>& differences) {
  const size_t stride = differences.size() / kMaxForSlopes + 1;
  const double span = differences.back().t - differences.front().t;
  std::vector<double> slopes;
  for (size_t i = 0; i < differences.size(); i += stride) {
    for (size_t j = i + stride; j < differences.size(); j += stride) {
      const double step = differences[j].t - differences[i].t;
      if (step * 3 < span) continue;
      slopes.push_back((differences[j].later - differences[i].later) / step);
    }
  }
  return slopes.empty() ? 0 : median(std::move(slopes));
}

}  // namespace

SyncReport measure_sync(std::span<const SyncStamp> a, std::span<const SyncStamp> b) {
  SyncReport report;
  report.frames_a = a.size();
  report.frames_b = b.size();
  const double period_a = period_of(a), period_b = period_of(b);
  if (period_a > 0) report.rate_a_hz = 1 / period_a;
  if (period_b > 0) report.rate_b_hz = 1 / period_b;
  if (period_a <= 0 || period_b <= 0) return report;
  const double period = std::max(period_a, period_b);
  const auto differences = pair_up(a, b, period);
  report.pairs = differences.size();
  if (report.pairs < kMinPairs) return report;
  const double slope = slope_of(differences);
  std::vector<double> offsets, errors;
  for (const Difference& d : differences) {
    offsets.push_back(d.later - slope * d.t);
    errors.push_back(d.error);
  }
  const double offset = median(offsets);
  double squares = 0;
  for (const double value : offsets) squares += (value - offset) * (value - offset);
  const double jitter = std::sqrt(squares / static_cast<double>(offsets.size()));
  const double span = differences.back().t - differences.front().t;
  double phase = offset + slope * differences.back().t;
  phase -= period * std::round(phase / period);
  const double error = median(errors);
  const double spread = 3.3 * jitter / std::sqrt(static_cast<double>(offsets.size()));
  report.phase = from_seconds(phase);
  report.phase_error = from_seconds(error + 2 * spread);
  report.drift = slope;
  // The errors of the cameras' clocks may have changed by all of their bound meanwhile.
  report.drift_error = span > 0 ? (quantile(errors, 0.95) + 3.5 * spread) / span : 0;
  report.jitter = from_seconds(jitter);
  return report;
}

}  // namespace sightline
