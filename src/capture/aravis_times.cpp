// SPDX-License-Identifier: Apache-2.0
#include "aravis_times.hpp"

#include <algorithm>

namespace sightline {
namespace {

using namespace std::chrono_literals;

constexpr Duration kUnknownPeriod = 100ms;
constexpr Duration kNetworkSlack = 200us;  // interrupt, queue and packet handling on the host
constexpr double kReadoutBytesPerSecond = 125e6;  // gigabit, the slowest common read-out

Duration microseconds(double us) { return from_seconds(us * 1e-6); }

Duration period_of(const AravisSettings& settings) {
  return settings.rate_hz > 0 ? from_seconds(1 / settings.rate_hz) : kUnknownPeriod;
}

Duration transit_of(const AravisOptions& options, const AravisSettings& settings) {
  if (options.transit_us >= 0) return microseconds(options.transit_us);
  return options.stamp == ExposureStamp::kStart ? microseconds(settings.exposure_us) : Duration{0};
}

Duration transit_error_of(const AravisOptions& options, const AravisSettings& settings) {
  if (options.transit_us >= 0) return kNetworkSlack;
  const Duration readout =
      from_seconds(static_cast<double>(settings.payload) / kReadoutBytesPerSecond);
  return std::max(transit_of(options, settings), std::min(readout, period_of(settings))) +
         kNetworkSlack;
}

ClockMapOptions clock_options(const AravisOptions& options, const AravisSettings& settings) {
  ClockMapOptions clock;
  clock.period = period_of(settings);
  clock.transit = transit_of(options, settings);
  clock.transit_error = transit_error_of(options, settings);
  return clock;
}

}  // namespace

AravisTimes::AravisTimes(const AravisOptions& options, const AravisSettings& settings)
    : half_exposure_(microseconds(settings.exposure_us / 2)),
      exposure_error_(microseconds(settings.exposure_range_us / 2)),
      transit_(transit_of(options, settings)),
      transit_error_(transit_error_of(options, settings)),
      period_(period_of(settings)),
      label_(options.ptp ? ClockLabel::kTai : ClockLabel::kDevice),
      clock_(clock_options(options, settings)) {
  if (options.stamp == ExposureStamp::kEnd) half_exposure_ = -half_exposure_;
}

void AravisTimes::stamp(const FrameStamps& stamps, FrameInfo& info) {
  const ClockMap::Event event = clock_.add(stamps.device_ns, stamps.first_packet);
  info.arrival = stamps.arrival;
  info.device_time_ns = stamps.device_ns;
  info.device_clock = stamps.device_ns > 0 ? label_ : ClockLabel::kNone;
  Time stamped = stamps.first_packet - transit_;
  Duration bound = transit_error_ + period_;
  if (event != ClockMap::Event::kRejected) {
    if (const auto mapped = clock_.map(stamps.device_ns)) {
      stamped = mapped->time;
      bound = mapped->bound;
    }
  }
  info.capture = std::min(stamped + half_exposure_, stamps.arrival);
  info.capture_error = bound + exposure_error_;
}

}  // namespace sightline
