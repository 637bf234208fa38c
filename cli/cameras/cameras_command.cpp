// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cameras/camera_probe.hpp"
#include "cameras/camera_sync_command.hpp"
#include "cameras/device_listing.hpp"
#include "commands.hpp"
#include "report.hpp"
#include "sightline/pipeline/source_factory.hpp"
#include "sightline/record/overlay_video.hpp"

namespace sightline::cli {
namespace {

using Json = nlohmann::ordered_json;

std::string rates_of(const FormatInfo& format) {
  if (format.rates_hz.empty()) return "";
  const auto [low, high] = std::minmax_element(format.rates_hz.begin(), format.rates_hz.end());
  return *low == *high ? fmt::format(" {:.4g} Hz", *high)
                       : fmt::format(" {:.4g}..{:.4g} Hz", *low, *high);
}

void print_table(const DeviceListing& listing) {
  size_t widest = 6;
  for (const DeviceInfo& device : listing.devices) {
    widest = std::max(widest, source_of(device).size());
  }
  if (listing.devices.empty()) fmt::print("no cameras found\n");
  for (const DeviceInfo& device : listing.devices) {
    fmt::print("{:<{}}  {}", source_of(device), widest, device.model);
    if (!device.serial.empty()) fmt::print(", serial {}", device.serial);
    fmt::print(", at {}\n", device.where);
    if (!device.note.empty()) fmt::print("    {}\n", device.note);
    for (const FormatInfo& format : device.formats) {
      fmt::print("    {:<14} {}x{}{}\n", format.pixel_format, format.width, format.height,
                 rates_of(format));
    }
  }
  for (const std::string& note : listing.notes) fmt::print("{}\n", note);
}

// A camera of an installation, with its settings, or a bare source as a configuration names it.
Result<SourceFactory::Opener> opener_for(const CamerasOptions& options, SourceFactory& factory) {
  if (!options.config.empty()) {
    SL_ASSIGN(const Installation installation, read_installation(options.config));
    for (size_t i = 0; i < installation.cameras.size(); ++i) {
      if (installation.cameras[i].name != options.source) continue;
      return factory.opener(installation.cameras[i], CameraId(static_cast<uint32_t>(i)), false);
    }
    return make_error(ErrorCode::kNotFound, options.config.string(), "there is no camera \"{}\"",
                      options.source);
  }
  return bare_opener(options.source);
}

Json json_of(const ProbeReport& report) {
  return Json{{"source", report.source},
              {"width", report.width},
              {"height", report.height},
              {"format", report.format},
              {"frames", report.frames},
              {"seconds", report.seconds},
              {"first_frame_s", report.first_frame_s},
              {"rate_hz", report.rate_hz},
              {"jitter_ms", report.jitter_ms},
              {"jitter_max_ms", report.jitter_max_ms},
              {"latency_ms", report.latency_ms},
              {"latency_p99_ms", report.latency_p99_ms},
              {"clock", report.clock},
              {"capture_error_ms", report.capture_error_ms},
              {"dropped", report.dropped},
              {"damaged", report.damaged}};
}

void print(const ProbeReport& report) {
  fmt::print("source          {}\n", report.source);
  fmt::print("images          {} x {}, {}\n", report.width, report.height, report.format);
  fmt::print("first frame     after {:.2f} s\n", report.first_frame_s);
  fmt::print("frames          {} in {:.1f} s: {:.2f} Hz\n", report.frames, report.seconds,
             report.rate_hz);
  fmt::print("jitter          {:.2f} ms (standard deviation of the interval), {:.2f} ms at most\n",
             report.jitter_ms, report.jitter_max_ms);
  fmt::print("latency         {:.1f} ms from capture to arrival (median), {:.1f} ms (99 %)\n",
             report.latency_ms, report.latency_p99_ms);
  fmt::print("capture times   from {}, wrong by at most {:.2f} ms\n", report.clock,
             report.capture_error_ms);
  fmt::print("lost            {} dropped, {} damaged\n", report.dropped, report.damaged);
}

Status probe_camera_of(const CamerasOptions& options) {
  Registry registry;
  SourceFactory factory(registry);
  SL_ASSIGN(const auto opener, opener_for(options, factory));
  SL_ASSIGN(ProbeResult result, run_probe(opener, options.seconds));
  result.report.source = options.config.empty() ? shown_source(options.source) : options.source;
  if (!options.save.empty()) {
    SL_RETURN_IF_ERROR(write_png(options.save, result.newest->i420()));
  }
  if (options.json) {
    fmt::print("{}\n", json_of(result.report).dump(2));
  } else {
    print(result.report);
  }
  return {};
}

int cameras(const CamerasOptions& options) {
  if (!options.sync.empty()) return sync_cameras(options);
  if (!options.source.empty()) {
    const Status done = probe_camera_of(options);
    return done ? 0 : report(done.error());
  }
  const DeviceListing listing = list_devices();
  if (options.json) {
    // What devices call themselves need not be UTF-8.
    fmt::print("{}\n", json_of(listing).dump(2, ' ', false, Json::error_handler_t::replace));
  } else {
    print_table(listing);
  }
  return 0;
}

}  // namespace

void add_cameras(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<CamerasOptions>();
  auto* command = app.add_subcommand("cameras", "list what is plugged in, or probe a camera");
  auto* probe = command->add_option("--probe", options->source,
                                    "grab from this source (or camera of --config) and measure");
  command->add_option("--sync", options->sync, "phase and drift between two of these (A B)")
      ->expected(2)
      ->excludes(probe);
  command->add_option("--config", options->config, "installation file that has the cameras");
  command->add_option("--seconds", options->seconds, "how long (default 5)")
      ->check(CLI::Range(0.1, 86400.0));
  command->add_option("--save", options->save, "write the last image as PNG")->needs(probe);
  command->add_flag("--json", options->json, "as JSON");
  command->callback([options, command, &chosen] {
    const bool listing = options->source.empty() && options->sync.empty();
    if (listing && command->count("--seconds") + command->count("--config") > 0) {
      throw CLI::ValidationError("--seconds and --config go with --probe or --sync");
    }
    chosen = [options] { return cameras(*options); };
  });
}

}  // namespace sightline::cli
