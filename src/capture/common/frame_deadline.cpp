// SPDX-License-Identifier: Apache-2.0
#include "capture/common/frame_deadline.hpp"

#include <algorithm>

namespace sightline::capture {
namespace {

constexpr int kPeriods = 5;

}  // namespace

Duration frame_period(double rate_hz) {
  return rate_hz > 0 ? from_seconds(1 / rate_hz) : Duration(0);
}

Duration frame_deadline(Duration asked, double rate_hz, Duration at_least) {
  return asked > Duration(0) ? asked : std::max(at_least, kPeriods * frame_period(rate_hz));
}

}  // namespace sightline::capture
