// SPDX-License-Identifier: Apache-2.0
#include "capture/aravis/latch_map.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sightline::capture {
namespace {

constexpr double kMaxRateError = 500e-6;
constexpr int64_t kSlackNs = 1'000'000;     // a latch this far off the others is no contradiction
constexpr int64_t kNarrowSlackNs = 20'000;  // widths that differ by less count as equal
constexpr int64_t kUselessNs = 20'000'000;
constexpr size_t kForLine = 5;
constexpr size_t kForSlope = 4;
constexpr size_t kForScatter = 5;
constexpr int64_t kSpanForSlopeNs = 2'500'000'000;
// 99.9 % of normally distributed readings are within 3.3 standard deviations, of which a few
// latches tell little: half more.
constexpr double kScatterQuantile = 5;

double to_double(int64_t ns) { return static_cast<double>(ns); }

template <typename Array>
double median(Array& values, size_t count) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(count / 2);
  std::nth_element(values.begin(), middle, values.begin() + static_cast<ptrdiff_t>(count));
  return *middle;
}

}  // namespace

void LatchMap::add(const Latch& latch) {
  if (latch.answered < latch.sent || latch.device_ns <= 0) return;
  Sample made;
  made.device_ns = latch.device_ns;
  made.half_ns = (latch.answered - latch.sent).count() / 2;
  made.offset_ns = to_ns(latch.sent) + made.half_ns - latch.device_ns;
  if (count_ > 0 && contradicts(made)) reset();
  if (count_ == kKept) {
    first_ = (first_ + 1) % kKept;
    --count_;
  }
  sample(count_++) = made;
  choose_good();
  fit();
}

bool LatchMap::contradicts(const Sample& made) const {
  const Sample& last = sample(count_ - 1);
  const int64_t step = made.device_ns - last.device_ns;
  if (step < -kSlackNs) return true;  // small steps back are jitter
  const double off = std::abs(to_double(made.offset_ns - last.offset_ns));
  return off > to_double(made.half_ns + last.half_ns + kSlackNs) +
                   kMaxRateError * to_double(std::max<int64_t>(step, 0));
}

// An answer that was lost on the way makes a latch of half a second, which only tells that it is
// one.
void LatchMap::choose_good() {
  std::array<int64_t, kKept> widths{};
  for (size_t i = 0; i < count_; ++i) widths[i] = sample(i).half_ns;
  std::sort(widths.begin(), widths.begin() + static_cast<ptrdiff_t>(count_));
  // A third of them in any case: a line needs some, and from all over the time.
  const int64_t third = widths[std::min(count_ - 1, std::max(kForLine, count_ / 3))];
  const int64_t widest = std::max(3 * widths[0] + kNarrowSlackNs, std::min(third, kUselessNs));
  for (size_t i = 0; i < count_; ++i) sample(i).good = sample(i).half_ns <= widest;
}

void LatchMap::fit() {
  std::array<size_t, kKept> good{};
  size_t n = 0;
  for (size_t i = 0; i < count_; ++i) {
    if (sample(i).good) good[n++] = i;
  }
  anchor_device_ns_ = sample(good[0]).device_ns;
  anchor_offset_ns_ = sample(good[0]).offset_ns;
  const int64_t span = sample(good[n - 1]).device_ns - anchor_device_ns_;
  const bool known = n >= kForSlope && span >= kSpanForSlopeNs;
  slope_ = 0;
  if (known) {
    std::array<double, kKept * kKept / 2> slopes{};
    size_t pairs = 0;
    for (size_t a = 0; a < n; ++a) {
      for (size_t b = a + 1; b < n; ++b) {
        const Sample& first = sample(good[a]);
        const Sample& second = sample(good[b]);
        const int64_t step = second.device_ns - first.device_ns;
        if (step * 3 < span) continue;  // near ones only add noise
        slopes[pairs++] = to_double(second.offset_ns - first.offset_ns) / to_double(step);
      }
    }
    slope_ = median(slopes, pairs);
  }
  std::array<double, kKept> residuals{}, widths{};
  offset_ns_ = 0;
  for (size_t a = 0; a < n; ++a) {
    const Sample& s = sample(good[a]);
    residuals[a] = residual_of(s);
    widths[a] = to_double(s.half_ns);
  }
  offset_ns_ = median(residuals, n);
  // A wide latch lies off the line because its two ways differ, a narrow one because the clock
  // itself is read with jitter; and frames' stamps have the latter alone.
  const size_t narrow = std::min(n, std::max(kForScatter, n / 3));
  std::array<double, kKept> sorted = widths;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<ptrdiff_t>(narrow - 1),
                   sorted.begin() + static_cast<ptrdiff_t>(n));
  double squares = 0, summed = 0;
  for (size_t a = 0; a < n; ++a) {
    if (widths[a] > sorted[narrow - 1]) continue;
    const double off = residual_of(sample(good[a]));
    squares += off * off;
    ++summed;
  }
  const double deviation = std::sqrt(squares / summed);
  scatter_ns_ = n > 1 ? kScatterQuantile * deviation : 0;
  slope_error_ = known ? slope_error(deviation) : kMaxRateError;
}

// Any two latches bound the rate by their widths over the time between them: the truth is no
// farther from the line's than the closest such bound says. What a share of the widths would say
// instead fails on a busy machine, where a few latches are narrow and the others wide to one side.
double LatchMap::slope_error(double deviation) const {
  double least = kMaxRateError;
  for (size_t a = 0; a < count_; ++a) {
    for (size_t b = a + 1; b < count_; ++b) {
      const Sample& first = sample(a);
      const Sample& second = sample(b);
      const double step = to_double(second.device_ns - first.device_ns);
      if (step <= 0) continue;
      const double slope = to_double(second.offset_ns - first.offset_ns) / step;
      const double reach = to_double(first.half_ns + second.half_ns) + 2 * deviation;
      least = std::min(least, std::abs(slope - slope_) + reach / step);
    }
  }
  return least;
}

double LatchMap::line_at(int64_t device_ns) const {
  return offset_ns_ + slope_ * to_double(device_ns - anchor_device_ns_);
}

double LatchMap::residual_of(const Sample& s) const {
  return to_double(s.offset_ns - anchor_offset_ns_) - line_at(s.device_ns);
}

std::optional<MappedTime> LatchMap::map(int64_t device_ns) const {
  if (count_ == 0) return std::nullopt;
  double bound = std::numeric_limits<double>::max();
  for (size_t i = 0; i < count_; ++i) {
    const Sample& s = sample(i);
    const double off = std::abs(residual_of(s));
    const double reach = slope_error_ * std::abs(to_double(device_ns - s.device_ns));
    bound = std::min(bound, off + to_double(s.half_ns) + reach);
  }
  MappedTime mapped;
  mapped.time = time_from_ns(device_ns + anchor_offset_ns_ + std::llround(line_at(device_ns)));
  mapped.bound = Duration(std::llround(bound + scatter_ns_));
  return mapped;
}

}  // namespace sightline::capture
