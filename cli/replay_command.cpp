// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "commands.hpp"
#include "progress.hpp"
#include "report.hpp"
#include "sightline/base/log.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/pipeline/replay_library.hpp"
#include "sightline/pipeline/replay_pipeline.hpp"
#include "start_argument.hpp"

namespace sightline::cli {
namespace {

struct ReplayOptions {
  std::filesystem::path recording;
  std::filesystem::path config;         ///< empty: what the recording says
  std::vector<std::string> modalities;  ///< of every object; empty: what its file says
  std::vector<std::string> features;    ///< OBJECT=FILE, or FILE for all: trained ones, instead
  std::filesystem::path poses;          ///< empty: none
  std::filesystem::path overlay;        ///< folder of videos; empty: none
  std::filesystem::path overlay_png;    ///< folder of images; empty: none
  std::filesystem::path points;         ///< PLY of stereo points; empty: none
  SearchTiming search;
  std::vector<std::string> starts;  ///< NAME=..., see start_argument.hpp
  bool realtime = false;
  bool json = false;
};

using Json = nlohmann::ordered_json;

// Sleeps until a recorded time has come, counted from the first one.
class Pace {
 public:
  explicit Pace(bool realtime) : realtime_(realtime) {}
  void wait_for(Time recorded) {
    if (!realtime_) return;
    if (!started_) {
      offset_ = MonotonicClock::now() - recorded;
      started_ = true;
    }
    std::this_thread::sleep_for(recorded + offset_ - MonotonicClock::now());
  }

 private:
  const bool realtime_;
  bool started_ = false;
  Duration offset_{};
};

// "NAME=FILE" for one object, "FILE" for all.
Status use_features(const std::vector<std::string>& arguments, Installation& installation) {
  for (const std::string& argument : arguments) {
    const size_t equals = argument.find('=');
    const std::string name = equals == std::string::npos ? "" : argument.substr(0, equals);
    bool used = false;
    for (ObjectConfig& object : installation.objects) {
      if (!name.empty() && object.description.name != name) continue;
      object.description.features = name.empty() ? argument : argument.substr(equals + 1);
      used = true;
    }
    if (used) continue;
    return make_error(ErrorCode::kInvalidInput, "--features", "there is no object \"{}\"", name);
  }
  return {};
}

Status use_starts(const std::vector<std::string>& arguments, const Installation& installation,
                  ReplayPipeline& pipeline) {
  for (const std::string& argument : arguments) {
    SL_ASSIGN(const StartArgument start, parse_start(argument, installation, "--start"));
    if (pipeline.hint(start.object, start.hint)) continue;
    return make_error(ErrorCode::kInvalidInput, "--start " + argument,
                      "it is not searched for: it has markers (--modalities region,edge,texture "
                      "does without), or [detect] is off");
  }
  return {};
}

Result<ReplaySummary> run(const ReplayOptions& options) {
  SL_ASSIGN(Recording opened, open_recording(options.recording));
  for (const std::string& warning : opened.warnings) log::warning("{}", warning);
  const auto recording = std::make_shared<const Recording>(std::move(opened));
  SL_ASSIGN(Installation installation, options.config.empty()
                                           ? recording_installation(options.recording)
                                           : read_installation(options.config));
  if (!options.modalities.empty()) {
    SL_ASSIGN(const Modalities modalities, parse_modalities(options.modalities, "--modalities"));
    for (ObjectConfig& object : installation.objects) object.description.modalities = modalities;
  }
  SL_RETURN_IF_ERROR(use_features(options.features, installation));
  std::unique_ptr<PoseLogWriter> log;
  if (!options.poses.empty()) {
    SL_ASSIGN(log, PoseLogWriter::create(options.poses));
  }
  SL_ASSIGN(auto pipeline,
            ReplayPipeline::create(installation, recording, log.get(),
                                   {options.overlay, options.overlay_png, options.points},
                                   options.search));
  SL_RETURN_IF_ERROR(use_starts(options.starts, installation, *pipeline));
  SL_ASSIGN(auto replay, VirtualReplay::open(recording, {}, time_offsets(*recording, installation),
                                             axis_histories(*recording, installation)));
  ProgressBar bar("replay", recording->frame_count());
  Pace pace(options.realtime);
  for (;;) {
    SL_ASSIGN(const auto frames, replay->next());
    if (!frames) break;
    pace.wait_for(frames->front()->info().capture);
    SL_RETURN_IF_ERROR(pipeline->step(*frames));
    bar.set(pipeline->summary().frames);
  }
  SL_RETURN_IF_ERROR(pipeline->finish());
  return pipeline->summary();
}

Json to_json(const PointSummary& points) {
  return Json{{"points", points.points},
              {"corners", points.corners},
              {"pairs_of_images", points.sets},
              {"on_object", points.on_object},
              {"to_mesh_median_mm", points.median_mm},
              {"to_mesh_p90_mm", points.p90_mm}};
}

Json to_json(const TurnSummary& turn) {
  return Json{{"camera", turn.camera},
              {"frames", turn.frames},
              {"used", turn.used},
              {"latency_known", turn.last.latency_known},
              {"latency_contradicted", turn.last.latency_contradicted},
              {"latency_s", turn.last.latency_s},
              {"latency_sigma_s", turn.last.latency_sigma_s}};
}

std::string to_text(const TurnSummary& turn) {
  const RefinerStatus& last = turn.last;
  std::string latency = "its latency is not known";
  if (last.latency_known) {
    latency = fmt::format("its latency is {:.1f} ms, sigma {:.1f} ms{}", 1e3 * last.latency_s,
                          1e3 * last.latency_sigma_s,
                          last.latency_contradicted ? ": the calibration's is another" : "");
  }
  return fmt::format("{}: angles by the picture in {} of {} frames; {}\n", turn.camera, turn.used,
                     turn.frames, latency);
}

Json to_json(const ReplaySummary& summary) {
  Json json{{"frames", summary.frames},
            {"sets", summary.sets},
            {"rows_by_state", summary.rows_by_state},
            {"observe_cpu_ms", summary.observe_cpu_ms},
            {"fuse_cpu_ms", summary.fuse_cpu_ms},
            {"searches", summary.searches},
            {"search_cpu_ms", summary.search_cpu_ms},
            {"instant_search", summary.search_timing.instant}};
  if (!summary.search_timing.instant) {
    json["search_cost_factor"] = summary.search_timing.cost_factor;
    json["search_time_ms"] = summary.search_time_ms;
  }
  if (summary.points) json["stereo_points"] = to_json(*summary.points);
  for (const TurnSummary& turn : summary.turns) json["angles_by_picture"].push_back(to_json(turn));
  return json;
}

std::string charged(const SearchTiming& timing, double ms) {
  if (timing.instant) return "INSTANT: they took no time (--instant-search)";
  return fmt::format("charged with {:.0f} ms each{}", ms,
                     timing.cost_factor == 1
                         ? std::string()
                         : fmt::format(" (--search-cost {})", timing.cost_factor));
}

std::string to_text(const ReplaySummary& summary) {
  const double frames = static_cast<double>(std::max<size_t>(summary.frames, 1));
  std::string text = fmt::format(
      "{} frames in {} sets; CPU per frame: observe {:.2f} ms, fuse {:.3f} ms\n", summary.frames,
      summary.sets, summary.observe_cpu_ms / frames, summary.fuse_cpu_ms / frames);
  if (summary.searches > 0) {
    const auto searches = static_cast<double>(summary.searches);
    text += fmt::format("{} searches for objects, {:.0f} ms of CPU each, {}\n", summary.searches,
                        summary.search_cpu_ms / searches,
                        charged(summary.search_timing, summary.search_time_ms / searches));
  } else if (summary.search_timing.instant) {
    text += "instant search: one would have taken no time\n";
  }
  for (const auto& [object, states] : summary.rows_by_state) {
    text += object + ":";
    for (const auto& [state, rows] : states) text += fmt::format(" {} {}", rows, state);
    text += "\n";
  }
  for (const TurnSummary& turn : summary.turns) text += to_text(turn);
  if (summary.points) {
    const PointSummary& p = *summary.points;
    text += fmt::format(
        "stereo points: {} ({} corners) of {} pairs of images; {} on an object by its pose, "
        "{:.2f} mm from the mesh (median; 90 %: {:.2f} mm)\n",
        p.points, p.corners, p.sets, p.on_object, p.median_mm, p.p90_mm);
  }
  return text;
}

int replay(const ReplayOptions& options) {
  const auto summary = run(options);
  if (!summary) return report(summary.error());
  fmt::print("{}", options.json ? to_json(*summary).dump(2) + "\n" : to_text(*summary));
  return 0;
}

}  // namespace

void add_replay(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<ReplayOptions>();
  auto* command = app.add_subcommand("replay", "run a recording through the pipeline");
  command->add_option("RECORDING", options->recording, "recording folder")->required();
  command->add_option("--config", options->config, "installation file (default: the recording)");
  command
      ->add_option("--modalities", options->modalities,
                   "measure objects only by these: fiducial, region, edge, texture")
      ->delimiter(',');
  command
      ->add_option("--features", options->features,
                   "find objects by the features in this file: FILE, or NAME=FILE for one of them")
      ->allow_extra_args(false);
  command->add_option("--poses", options->poses, "write the pose log here");
  command->add_option("--overlay", options->overlay, "write CAMERA.mkv as streamed to this folder");
  command->add_option("--overlay-png", options->overlay_png, "write single images to this folder");
  command->add_option("--points", options->points,
                      "write points that pairs of cameras reconstruct here (PLY)");
  command
      ->add_option("--start", options->starts,
                   "where an object is at the start: NAME=CAMERA:x,y[,radius], its middle in an "
                   "image, or NAME=tx,ty,tz,qw,qx,qy,qz, its pose in the world")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  auto* cost = command->add_option("--search-cost", options->search.cost_factor,
                                   "how long a search takes: times what it does on the machine of "
                                   "the documentation (default: 1)");
  cost->check(CLI::Range(0.0, 1000.0));
  command
      ->add_flag("--instant-search", options->search.instant,
                 "searches take no time: what is found enters with the frames it was found in")
      ->excludes(cost);
  command->add_flag("--realtime", options->realtime, "at the recording's own pace");
  command->add_flag("--json", options->json, "summary as JSON");
  command->callback([options, &chosen] { chosen = [options] { return replay(*options); }; });
}

}  // namespace sightline::cli
