// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/cell/clock_watch.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <vector>

namespace sightline {
namespace {

// Fields of `chronyc -c tracking`, as of chrony 4.
constexpr size_t kStratum = 2, kOffset = 4, kRootDelay = 10, kRootDispersion = 11, kLeap = 13;

std::optional<double> number(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

}  // namespace

std::optional<Duration> chrony_bound(std::string_view line) {
  std::vector<std::string_view> fields;
  line = line.substr(0, line.find_first_of("\r\n"));
  for (size_t begin = 0; begin <= line.size();) {
    const size_t end = std::min(line.find(',', begin), line.size());
    fields.push_back(line.substr(begin, end - begin));
    begin = end + 1;
  }
  if (fields.size() <= kLeap || fields[kStratum] == "0" || fields[kLeap].starts_with("Not")) {
    return std::nullopt;
  }
  const auto offset = number(fields[kOffset]), delay = number(fields[kRootDelay]),
             dispersion = number(fields[kRootDispersion]);
  if (!offset || !delay || !dispersion || *delay < 0 || *dispersion < 0) return std::nullopt;
  const double bound = std::abs(*offset) + *dispersion + *delay / 2;
  if (bound > 1e6) return std::nullopt;
  return from_seconds(bound);
}

bool ClockWatch::note(Time now, int64_t utc_ns, Duration uncertainty) {
  const int64_t offset = utc_ns - to_ns(now);
  if (!offset_ns_) {
    offset_ns_ = offset;
    return false;
  }
  const Duration moved(std::abs(offset - *offset_ns_));
  if (moved <= kSmallestStep + uncertainty) return false;
  offset_ns_ = offset;
  stepped_ = now;
  ++steps_;
  return true;
}

void ClockWatch::set_service(std::optional<Duration> bound, std::string problem) {
  service_ = bound;
  problem_ = std::move(problem);
}

ClockState ClockWatch::state(Time now) const {
  ClockState state;
  state.bound = service_.value_or(configured_bound_);
  state.text = service_ ? "chrony" : "as configured";
  if (!problem_.empty()) {
    state.text = problem_;
  } else if (stepped_ && now - *stepped_ < kAfterStep) {
    state.text = "has just been set anew";
  } else if (state.bound > limit_) {
    state.text = fmt::format("may be {:.1f} ms off, {:.1f} are allowed",
                             1e3 * to_seconds(state.bound), 1e3 * to_seconds(limit_));
  } else {
    state.fit = true;
  }
  return state;
}

}  // namespace sightline
