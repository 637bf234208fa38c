// SPDX-License-Identifier: Apache-2.0
#include "capture/common/frame_stamps.hpp"

#include <algorithm>
#include <chrono>

namespace sightline::capture {
namespace {

using std::chrono::milliseconds;

constexpr Duration kUnknownPeriod = milliseconds(33);
constexpr Duration kStampJitter = std::chrono::microseconds(500);
// The driver keeps a few old frames while nobody takes them; their stamps are old, and right.
constexpr Duration kOldestStamp = std::chrono::seconds(10);

}  // namespace

StampMapper::StampMapper(StampPoint point, Duration period, std::optional<Duration> exposure)
    : point_(point), period_(period > Duration(0) ? period : kUnknownPeriod), exposure_(exposure) {}

bool StampMapper::plausible(Time stamp, Time arrival) const {
  if (to_ns(stamp) == 0 || stamp > arrival + period_ || stamp < arrival - kOldestStamp) {
    return false;
  }
  return !last_ || stamp > *last_;
}

CaptureTime StampMapper::map(std::optional<Time> stamp, Time arrival) {
  if (!stamp || !plausible(*stamp, arrival)) {
    last_.reset();  // or one wrong stamp that looked right would condemn all that follow
    return {arrival, 2 * period_, true};
  }
  last_ = stamp;
  Duration from{0}, to{0};
  if (point_ == StampPoint::kStartOfExposure) {
    from = exposure_ ? *exposure_ / 2 : Duration(0);
    to = exposure_ ? from : period_ / 2;
  } else {
    from = exposure_ ? -period_ - *exposure_ / 2 : -period_ * 3 / 2;
    to = exposure_ ? -*exposure_ / 2 : Duration(0);
  }
  CaptureTime time{*stamp + (from + to) / 2, std::max((to - from) / 2, kStampJitter), false};
  if (time.capture > arrival) {  // nothing is exposed after it arrived
    time.error += time.capture - arrival;
    time.capture = arrival;
  }
  return time;
}

}  // namespace sightline::capture
