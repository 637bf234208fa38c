// SPDX-License-Identifier: Apache-2.0
// A small client for tests with simulated cameras: opens the camera, reads it, opens it again when
// it is lost, and reports as lines "EVENT rest". Ends when its standard input closes.
//   aravis_client list
//   aravis_client open ID [key=value ...]
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>

#include "pattern_check.hpp"
#include "sightline/capture/aravis/aravis_source.hpp"

namespace {

using namespace sightline;
using namespace std::chrono_literals;

constexpr Duration kReopenAfter = 250ms;

template <typename... Args>
void say(fmt::format_string<Args...> format, Args&&... args) {
  fmt::print("{}\n", fmt::format(format, std::forward<Args>(args)...));
  std::fflush(stdout);
}

bool told_to_end(Duration wait) {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  return ::poll(&input, 1, static_cast<int>(wait / 1ms)) > 0;
}

struct Settings {
  AravisOptions aravis;
  int hold = 0;        // frames kept in hand
  bool fire = false;   // a software trigger for every frame
  bool check = false;  // images against gige_simulator's pattern
};

void read_into(int& to, const std::string& text) { to = std::atoi(text.c_str()); }
void read_into(uint32_t& to, const std::string& text) {
  to = static_cast<uint32_t>(std::atoi(text.c_str()));
}
void read_into(bool& to, const std::string& text) { to = text != "0"; }
void read_into(double& to, const std::string& text) { to = std::atof(text.c_str()); }
void read_into(std::string& to, const std::string& text) { to = text; }

struct Key {
  std::string_view name;
  void (*set)(Settings& settings, const std::string& value);
};
constexpr Key kKeys[] = {
    {"width", [](Settings& s, const std::string& v) { read_into(s.aravis.width, v); }},
    {"height", [](Settings& s, const std::string& v) { read_into(s.aravis.height, v); }},
    {"rate", [](Settings& s, const std::string& v) { read_into(s.aravis.rate_hz, v); }},
    {"exposure", [](Settings& s, const std::string& v) { read_into(s.aravis.exposure_us, v); }},
    {"transit", [](Settings& s, const std::string& v) { read_into(s.aravis.transit_us, v); }},
    {"format", [](Settings& s, const std::string& v) { read_into(s.aravis.pixel_format, v); }},
    {"trigger", [](Settings& s, const std::string& v) { read_into(s.aravis.trigger, v); }},
    {"packet_size", [](Settings& s, const std::string& v) { read_into(s.aravis.packet_size, v); }},
    {"packet_socket",
     [](Settings& s, const std::string& v) { read_into(s.aravis.packet_socket, v); }},
    {"buffers", [](Settings& s, const std::string& v) { read_into(s.aravis.buffers, v); }},
    {"ptp", [](Settings& s, const std::string& v) { read_into(s.aravis.ptp, v); }},
    {"gain", [](Settings& s, const std::string& v) { read_into(s.aravis.gain, v); }},
    {"edge",
     [](Settings& s, const std::string& v) {
       s.aravis.trigger_edge = v == "falling" ? TriggerEdge::kFalling : TriggerEdge::kRising;
     }},
    {"delay", [](Settings& s, const std::string& v) { read_into(s.aravis.trigger_delay_us, v); }},
    {"strobe", [](Settings& s, const std::string& v) { read_into(s.aravis.strobe, v); }},
    {"group", [](Settings& s, const std::string& v) { read_into(s.aravis.action.group_key, v); }},
    {"latch", [](Settings& s, const std::string& v) { read_into(s.aravis.latch, v); }},
    {"chunks", [](Settings& s, const std::string& v) { read_into(s.aravis.chunks, v); }},
    {"stamp",
     [](Settings& s, const std::string& v) {
       s.aravis.stamp = v == "end" ? ExposureStamp::kEnd : ExposureStamp::kStart;
     }},
    {"resend", [](Settings& s, const std::string& v) { read_into(s.aravis.resend, v); }},
    {"resend_ratio",
     [](Settings& s, const std::string& v) { read_into(s.aravis.resend_ratio, v); }},
    {"packet_timeout",
     [](Settings& s, const std::string& v) { read_into(s.aravis.packet_timeout_us, v); }},
    {"retention",
     [](Settings& s, const std::string& v) { read_into(s.aravis.frame_retention_us, v); }},
    {"socket_buffer",
     [](Settings& s, const std::string& v) { read_into(s.aravis.socket_buffer, v); }},
    {"packet_delay",
     [](Settings& s, const std::string& v) { read_into(s.aravis.packet_delay_ns, v); }},
    {"check", [](Settings& s, const std::string& v) { read_into(s.check, v); }},
    {"hold", [](Settings& s, const std::string& v) { read_into(s.hold, v); }},
    {"fire", [](Settings& s, const std::string& v) { read_into(s.fire, v); }},
};

bool set(Settings& settings, std::string_view name, const std::string& value) {
  const auto* const key = std::find_if(std::begin(kKeys), std::end(kKeys),
                                       [name](const Key& k) { return k.name == name; });
  if (key == std::end(kKeys)) return false;
  key->set(settings, value);
  return true;
}

void say_status(const AravisStatus& s) {
  say("status delivered={} lost={} incomplete={} unusable={} copied={} underruns={} "
      "stamps_rejected={} clock_resets={} drift={} bound_ns={} id={} format={} resent={} "
      "missing={} "
      "requests={} refused={} limited={} duplicates={} aborted={} triggers={} packet_size={} "
      "ptp={} "
      "ptp_offset={} latched={:d} chunks={:d}",
      s.delivered, s.lost, s.incomplete, s.unusable, s.copied, s.underruns, s.stamps_rejected,
      s.clock_resets, s.clock_drift, s.clock_bound.count(), s.device_id, s.pixel_format,
      s.resent_packets, s.missing_packets, s.resend_requests, s.resend_refused, s.resend_limited,
      s.duplicate_packets, s.aborted, s.triggers, s.packet_size, s.ptp,
      s.ptp_offset_ns ? fmt::to_string(*s.ptp_offset_ns) : "", s.latched, s.chunks);
}

// Until the camera is lost or we are told to end (true).
bool read(AravisSource& source, const Settings& settings) {
  std::deque<FramePtr> held;
  uint64_t frames = 0;
  std::optional<capture::PatternCheck> check;
  if (settings.check) {
    check.emplace(source.status().pixel_format, source.info().width, source.info().height);
  }
  for (;;) {
    if (told_to_end(0ms)) {
      say_status(source.status());
      return true;
    }
    if (settings.fire) {
      if (const Status fired = source.trigger(); !fired) say("error {}", fired.error().message());
    }
    const auto step = source.next({}, 100ms);
    if (!step) {
      say_status(source.status());
      say("error {}", step.error().message());
      return false;
    }
    if (step->kind != SourceStep::Kind::kFrame) continue;
    const Frame& frame = *step->frame;
    const FrameInfo& info = frame.info();
    // The simulated camera stamps with the host's wall clock: its truth is known.
    const Time truth = info.arrival - Duration(utc_ns_of(info.arrival) - info.device_time_ns);
    const I420View image = frame.i420();
    say("frame n={} epoch={} sequence={} dropped={} width={} height={} payload={} luma={} "
        "error_ns={} bound_ns={} age_ns={} device_ns={} capture_ns={} pattern={}",
        frames++, info.epoch, info.sequence, info.dropped_before, info.width, info.height,
        frame.payload().bytes.size(), image.y.row(info.height / 2)[info.width / 2],
        (info.capture - truth).count(), info.capture_error.count(),
        (info.arrival - info.capture).count(), info.device_time_ns, to_ns(info.capture),
        check ? check->find(frame) : -1);
    held.push_back(step->frame);
    while (held.size() > static_cast<size_t>(settings.hold)) held.pop_front();
  }
}

int open(const Settings& settings) {
  for (uint32_t epoch = 0;; ++epoch) {
    auto source = open_aravis_source(settings.aravis, CameraId(0), "cam", epoch);
    if (source) {
      const SourceInfo& info = (*source)->info();
      say("open width={} height={} rate={}", info.width, info.height, info.nominal_rate_hz);
      if (read(**source, settings)) return 0;
    } else {
      say("error {}", source.error().message());
      if (source.error().code == ErrorCode::kInvalidInput) return exit_code(source.error());
    }
    source = Error{};  // gives the camera back before the wait
    say("closed");
    if (told_to_end(kReopenAfter)) return 0;
  }
}

int list() {
  const auto devices = list_aravis(true);
  if (!devices) {
    say("error {}", devices.error().message());
    return exit_code(devices.error());
  }
  for (const DeviceInfo& device : *devices) {
    std::string formats;
    for (const FormatInfo& format : device.formats) formats += format.pixel_format + ",";
    say("device id={} serial={} where={} formats={} note={}", device.id, device.serial,
        device.where, formats, device.note);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 2 && std::string_view(argv[1]) == "list") return list();
  if (argc < 3 || std::string_view(argv[1]) != "open") return 2;
  Settings settings;
  settings.aravis.id = argv[2];
  for (int i = 3; i < argc; ++i) {
    const std::string_view argument(argv[i]);
    const size_t equals = std::min(argument.find('='), argument.size() - 1);
    if (!set(settings, argument.substr(0, equals), std::string(argument.substr(equals + 1)))) {
      return 2;
    }
  }
  return open(settings);
}
