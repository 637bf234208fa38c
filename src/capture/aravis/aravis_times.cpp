// SPDX-License-Identifier: Apache-2.0
#include "capture/aravis/aravis_times.hpp"

#include <algorithm>

namespace sightline::capture {
namespace {

using namespace std::chrono_literals;

constexpr Duration kUnknownPeriod = 100ms;
constexpr Duration kNetworkSlack = 200us;  // interrupt, queue and packet handling on the host
// The kernel hands packets of a packet socket over after 5 ms, in whole ticks of 4 ms on Debian.
constexpr Duration kBatch = 8ms;
constexpr Duration kMaxDelay = 1s;                // from the stamp to the first packet
constexpr double kReadoutBytesPerSecond = 125e6;  // gigabit, the slowest common read-out

Duration microseconds(double us) { return from_seconds(us * 1e-6); }

Duration period_of(const AravisSettings& settings) {
  return settings.rate_hz > 0 ? from_seconds(1 / settings.rate_hz) : kUnknownPeriod;
}

// From the stamp to when the first packet is seen.
Duration transit_of(const AravisOptions& options, const AravisSettings& settings) {
  const Duration batch = settings.packet_socket ? kBatch / 2 : Duration{0};
  if (options.transit_us >= 0) return microseconds(options.transit_us) + batch;
  return batch + (options.stamp == ExposureStamp::kStart ? microseconds(settings.exposure_us)
                                                         : Duration{0});
}

Duration transit_error_of(const AravisOptions& options, const AravisSettings& settings) {
  const Duration batch = settings.packet_socket ? kBatch / 2 : Duration{0};
  if (options.transit_us >= 0) return kNetworkSlack + batch;
  const Duration readout =
      from_seconds(static_cast<double>(settings.payload) / kReadoutBytesPerSecond);
  const Duration exposure =
      options.stamp == ExposureStamp::kStart ? microseconds(settings.exposure_us) : Duration{0};
  return std::max(exposure, std::min(readout, period_of(settings))) + kNetworkSlack + batch;
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
      at_end_(options.stamp == ExposureStamp::kEnd),
      exposure_error_(microseconds(settings.exposure_range_us / 2)),
      transit_(transit_of(options, settings)),
      transit_error_(transit_error_of(options, settings)),
      period_(period_of(settings)),
      clock_(clock_options(options, settings)) {}

// Latches are believed while what they say of a stamp can be: nothing is sent before it is exposed,
// and not long after. They contradict that when the camera's clock was set since the last one.
std::optional<MappedTime> AravisTimes::map(const FrameStamps& stamps, ClockMap::Event event) {
  latched_ = false;
  if (event == ClockMap::Event::kReset) latches_.reset();
  if (event == ClockMap::Event::kRejected) return std::nullopt;
  if (const auto mapped = latches_.map(stamps.device_ns)) {
    const Duration delay = stamps.first_packet - mapped->time;
    if (delay >= -mapped->bound - kNetworkSlack && delay <= kMaxDelay + 5 * period_) {
      latched_ = true;
      return mapped;
    }
    latches_.reset();
  }
  return clock_.map(stamps.device_ns);
}

void AravisTimes::stamp(const FrameStamps& stamps, FrameInfo& info) {
  const auto mapped = map(stamps, clock_.add(stamps.device_ns, stamps.first_packet));
  info.arrival = stamps.arrival;
  info.device_time_ns = stamps.device_ns;
  info.device_clock = stamps.device_ns > 0 ? label_ : ClockLabel::kNone;
  const Time stamped = mapped ? mapped->time : stamps.first_packet - transit_;
  bound_ = mapped ? mapped->bound : transit_error_ + period_;
  const Duration half = stamps.exposure_us ? microseconds(*stamps.exposure_us / 2) : half_exposure_;
  info.capture = std::min(stamped + (at_end_ ? -half : half), stamps.arrival);
  info.capture_error = bound_ + (stamps.exposure_us ? Duration{0} : exposure_error_);
}

}  // namespace sightline::capture
