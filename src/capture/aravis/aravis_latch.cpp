// SPDX-License-Identifier: Apache-2.0
#include "capture/aravis/aravis_latch.hpp"

namespace sightline::capture {
namespace {

struct Names {
  const char* command;
  const char* value;
  bool in_ticks;
};

// GigE Vision's own, then the SFNC's, which counts nanoseconds.
constexpr Names kNames[] = {{"GevTimestampControlLatch", "GevTimestampValue", true},
                            {"TimestampLatch", "TimestampLatchValue", false}};

}  // namespace

std::optional<AravisLatch> AravisLatch::find(ArvCamera* camera) {
  const auto has = [&](const char* feature) {
    return ask(false, [&](GError** e) {
      return arv_camera_is_feature_available(camera, feature, e) != 0;
    });
  };
  for (const Names& names : kNames) {
    if (!has(names.command) || !has(names.value)) continue;
    AravisLatch latch;
    latch.command_ = names.command;
    latch.value_ = names.value;
    ArvDevice* const device = arv_camera_get_device(camera);
    if (names.in_ticks && ARV_IS_GV_DEVICE(device)) {
      latch.ticks_per_second_ = ask(uint64_t{0}, [&](GError** e) {
        return arv_gv_device_get_timestamp_tick_frequency(ARV_GV_DEVICE(device), e);
      });
    }
    if (latch.ticks_per_second_ > 0) return latch;
  }
  return std::nullopt;
}

std::optional<Latch> AravisLatch::take(ArvCamera* camera) const {
  Latch latch;
  latch.sent = MonotonicClock::now();
  const bool done = ask(false, [&](GError** e) {
    arv_camera_execute_command(camera, command_, e);
    return *e == nullptr;
  });
  latch.answered = MonotonicClock::now();
  if (!done) return std::nullopt;
  const int64_t value =
      ask(int64_t{0}, [&](GError** e) { return arv_camera_get_integer(camera, value_, e); });
  if (value <= 0) return std::nullopt;
  const auto ticks = static_cast<uint64_t>(value);
  latch.device_ns =
      static_cast<int64_t>(ticks / ticks_per_second_ * 1'000'000'000 +
                           ticks % ticks_per_second_ * 1'000'000'000 / ticks_per_second_);
  return latch;
}

}  // namespace sightline::capture
