// SPDX-License-Identifier: Apache-2.0
#include "cameras/camera_sync_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <thread>

#include "cameras/camera_probe.hpp"
#include "cameras/sync_advice.hpp"
#include "report.hpp"
#include "sightline/base/thread.hpp"
#include "sightline/pipeline/source_factory.hpp"
#include "workers/action_worker.hpp"

namespace sightline::cli {
namespace {

using namespace std::chrono_literals;
using Json = nlohmann::ordered_json;

// From the first frame on: before that, the rates of the cameras' clocks are not known well.
constexpr Duration kSettle = 4s;
constexpr Duration kFirstFrame = 10s;
constexpr Duration kTurn = 100ms;

struct Watched {
  SyncCamera camera;
  Opener open;
  std::vector<SyncStamp> stamps;  ///< on this host's clock
  std::vector<SyncStamp> device;  ///< on the camera's own
  std::optional<Error> error;     ///< it could not be opened
};

void note(const Frame& frame, Watched& watched) {
  const FrameInfo& info = frame.info();
  watched.stamps.push_back({info.capture, info.capture_error});
  watched.device.push_back({time_from_ns(info.device_time_ns), Duration{0}});
}

void watch(std::stop_token stop, Watched& watched, double seconds) {
  auto source = watched.open(stop);
  if (!source) {
    watched.error = source.error();
    return;
  }
  auto* const aravis = dynamic_cast<AravisSource*>(source->get());
  const Time opened = MonotonicClock::now();
  std::optional<Time> first;
  while (!stop.stop_requested()) {
    const Time now = MonotonicClock::now();
    if (first ? now > *first + kSettle + from_seconds(seconds) : now > opened + kFirstFrame) break;
    const auto step = (*source)->next(stop, kTurn);
    if (!step) {
      watched.camera.problem = step.error().text;
      break;
    }
    if (step->kind == SourceStep::Kind::kEnd) break;
    if (step->kind != SourceStep::Kind::kFrame) continue;
    if (!first) first = now;
    if (now > *first + kSettle) note(*step->frame, watched);
  }
  if (aravis != nullptr) watched.camera.status = aravis->status();
  if (!first && watched.camera.problem.empty()) {
    watched.camera.problem =
        fmt::format("it opens, but no frame came in {:.0f} s", to_seconds(kFirstFrame));
  }
}

Result<Watched> prepare(const std::string& name, const Installation* installation,
                        SourceFactory& factory) {
  Watched watched;
  watched.camera.name = name;
  if (installation == nullptr) {
    watched.camera.name = shown_source(name);
    watched.camera.aravis = name.starts_with("aravis:");
    SL_ASSIGN(watched.open, bare_opener(name));
    return watched;
  }
  const auto& cameras = installation->cameras;
  const auto found = std::find_if(cameras.begin(), cameras.end(),
                                  [&](const CameraConfig& c) { return c.name == name; });
  if (found == cameras.end()) {
    return make_error(ErrorCode::kNotFound, installation->file.string(),
                      "there is no camera \"{}\"", name);
  }
  if (found->source == SourceKind::kAravis) {
    watched.camera.aravis = true;
    watched.camera.settings = found->aravis;
    watched.open = [options = found->aravis,
                    name](const std::stop_token&) -> Result<std::unique_ptr<FrameSource>> {
      SL_ASSIGN(auto opened, open_aravis_source(options, CameraId(0), name));
      return std::unique_ptr<FrameSource>(std::move(opened));
    };
  } else {
    watched.open = factory.opener(*found, CameraId(0), false);
  }
  return watched;
}

bool on_ptp(const Watched& watched) {
  return watched.camera.status && watched.camera.status->ptp == "Slave" &&
         watched.camera.settings.ptp;
}

// The clocks of cameras that follow one PTP master agree better than either with the host's.
SyncReport measure(Watched& a, Watched& b, bool& by_ptp) {
  by_ptp = on_ptp(a) && on_ptp(b);
  if (!by_ptp) return measure_sync(a.stamps, b.stamps);
  for (Watched* watched : {&a, &b}) {
    const Duration offset(std::abs(watched->camera.status->ptp_offset_ns.value_or(1000)));
    for (SyncStamp& stamp : watched->device) stamp.error = offset + 1us;
  }
  return measure_sync(a.device, b.device);
}

double median_error_ms(const std::vector<SyncStamp>& stamps) {
  std::vector<double> errors;
  for (const SyncStamp& stamp : stamps) errors.push_back(to_seconds(stamp.error) * 1e3);
  if (errors.empty()) return 0;
  std::nth_element(errors.begin(), errors.begin() + static_cast<ptrdiff_t>(errors.size() / 2),
                   errors.end());
  return errors[errors.size() / 2];
}

void print(const Watched& a, const Watched& b, const SyncReport& report, bool by_ptp,
           const std::vector<std::string>& advice) {
  const auto line = [](const char* name, const std::string& text) {
    fmt::print("{:<12} {}\n", name, text);
  };
  line("A",
       fmt::format("{}: {} frames, {:.3f} Hz", a.camera.name, report.frames_a, report.rate_a_hz));
  line("B",
       fmt::format("{}: {} frames, {:.3f} Hz", b.camera.name, report.frames_b, report.rate_b_hz));
  if (report.pairs >= 5) {
    line("phase",
         fmt::format("B exposes {:+.3f} ms after A, wrong by at most {:.3f} ms",
                     to_seconds(report.phase) * 1e3, to_seconds(report.phase_error) * 1e3));
    line("drift", fmt::format("{:+.2f} us each second, wrong by at most {:.2f}", report.drift * 1e6,
                              report.drift_error * 1e6));
    line("jitter", fmt::format("{:.3f} ms (standard deviation of the phase)",
                               to_seconds(report.jitter) * 1e3));
    line("clock", by_ptp ? "the cameras' own, set by PTP (time stamps)"
                         : "this host's (middle of exposure)");
  }
  line("verdict", sync_verdict(report));
  for (const std::string& text : advice) fmt::print("- {}\n", text);
}

Json to_json(const Watched& a, const Watched& b, const SyncReport& report, bool by_ptp,
             const std::vector<std::string>& advice) {
  const auto camera = [](const Watched& watched, size_t frames, double rate) {
    Json json{{"name", watched.camera.name}, {"frames", frames}, {"rate_hz", rate}};
    if (watched.camera.status) {
      const AravisStatus& status = *watched.camera.status;
      json["device"] = status.device_id;
      json["trigger"] = watched.camera.settings.trigger;
      json["ptp"] = status.ptp;
      json["clock_drift"] = status.clock_drift;
      json["latched"] = status.latched;
    }
    if (!watched.camera.problem.empty()) json["problem"] = watched.camera.problem;
    return json;
  };
  Json json{{"a", camera(a, report.frames_a, report.rate_a_hz)},
            {"b", camera(b, report.frames_b, report.rate_b_hz)},
            {"pairs", report.pairs},
            {"verdict", sync_verdict(report)}};
  if (report.pairs >= 5) {
    json["phase_ms"] = to_seconds(report.phase) * 1e3;
    json["phase_error_ms"] = to_seconds(report.phase_error) * 1e3;
    json["drift_us_per_s"] = report.drift * 1e6;
    json["drift_error_us_per_s"] = report.drift_error * 1e6;
    json["jitter_ms"] = to_seconds(report.jitter) * 1e3;
    json["clock"] = by_ptp ? "ptp" : "host";
  }
  json["advice"] = advice;
  return json;
}

Status run(const CamerasOptions& options) {
  Registry registry;
  SourceFactory factory(registry);
  HeartbeatBoard beats;
  std::optional<Installation> installation;
  if (!options.config.empty()) {
    SL_ASSIGN(installation, read_installation(options.config));
  }
  const Installation* const rig = installation ? &*installation : nullptr;
  SL_ASSIGN(Watched a, prepare(options.sync[0], rig, factory));
  SL_ASSIGN(Watched b, prepare(options.sync[1], rig, factory));
  const auto actions = rig != nullptr ? ActionWorker::start(rig->action, registry, beats) : nullptr;
  {
    const auto start = [&](const char* name, Watched& watched) {
      return start_thread(name, [&watched, &options](std::stop_token stop) {
        watch(std::move(stop), watched, options.seconds);
      });
    };
    std::jthread first = start("sync-a", a), second = start("sync-b", b);
    first.join();
    second.join();
  }
  for (Watched* watched : {&a, &b}) {
    if (watched->error) return *watched->error;
    watched->camera.exposure_error_ms = median_error_ms(watched->stamps);
  }
  bool by_ptp = false;
  const SyncReport report = measure(a, b, by_ptp);
  const auto advice = sync_advice(a.camera, b.camera, report);
  if (options.json) {
    fmt::print("{}\n", to_json(a, b, report, by_ptp, advice).dump(2));
  } else {
    print(a, b, report, by_ptp, advice);
  }
  return {};
}

}  // namespace

int sync_cameras(const CamerasOptions& options) {
  const Status done = run(options);
  return done ? 0 : report(done.error());
}

}  // namespace sightline::cli
