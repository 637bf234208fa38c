// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "commands.hpp"
#include "progress.hpp"
#include "replay_pipeline.hpp"
#include "report.hpp"
#include "sightline/base/log.hpp"
#include "sightline/config/object_file.hpp"

namespace sightline::cli {
namespace {

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

Result<ReplaySummary> run(const ReplayOptions& options) {
  SL_ASSIGN(Recording opened, open_recording(options.recording));
  for (const std::string& warning : opened.warnings) log::warning("{}", warning);
  const auto recording = std::make_shared<const Recording>(std::move(opened));
  SL_ASSIGN(Installation installation, options.config.empty()
                                           ? recording_installation(options.recording)
                                           : read_installation(options.config));
  if (!options.cues.empty()) {
    SL_ASSIGN(const Cues cues, parse_cues(options.cues, "--cues"));
    for (ObjectConfig& object : installation.objects) object.description.cues = cues;
  }
  SL_RETURN_IF_ERROR(use_features(options.features, installation));
  std::unique_ptr<PoseLogWriter> log;
  if (!options.poses.empty()) {
    SL_ASSIGN(log, PoseLogWriter::create(options.poses));
  }
  SL_ASSIGN(auto pipeline,
            ReplayPipeline::create(installation, recording, log.get(),
                                   {options.overlay, options.overlay_png, options.points}));
  SL_ASSIGN(auto replay, VirtualReplay::open(recording));
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
              {"pairs_of_pictures", points.sets},
              {"on_object", points.on_object},
              {"to_mesh_median_mm", points.median_mm},
              {"to_mesh_p90_mm", points.p90_mm}};
}

Json to_json(const ReplaySummary& summary) {
  Json json{{"frames", summary.frames},
            {"sets", summary.sets},
            {"rows_by_state", summary.rows_by_state},
            {"observe_cpu_ms", summary.observe_cpu_ms},
            {"fuse_cpu_ms", summary.fuse_cpu_ms},
            {"searches", summary.searches},
            {"search_cpu_ms", summary.search_cpu_ms}};
  if (summary.points) json["stereo_points"] = to_json(*summary.points);
  return json;
}

std::string to_text(const ReplaySummary& summary) {
  const double frames = static_cast<double>(std::max<size_t>(summary.frames, 1));
  std::string text = fmt::format(
      "{} frames in {} sets; CPU per frame: observe {:.2f} ms, fuse {:.3f} ms\n", summary.frames,
      summary.sets, summary.observe_cpu_ms / frames, summary.fuse_cpu_ms / frames);
  if (summary.searches > 0) {
    text += fmt::format("{} searches for objects, {:.0f} ms of CPU each\n", summary.searches,
                        summary.search_cpu_ms / static_cast<double>(summary.searches));
  }
  for (const auto& [object, states] : summary.rows_by_state) {
    text += object + ":";
    for (const auto& [state, rows] : states) text += fmt::format(" {} {}", rows, state);
    text += "\n";
  }
  if (summary.points) {
    const PointSummary& p = *summary.points;
    text += fmt::format(
        "stereo points: {} ({} corners) of {} pairs of pictures; {} on an object by its pose, "
        "{:.2f} mm from the mesh (median; 90 %: {:.2f} mm)\n",
        p.points, p.corners, p.sets, p.on_object, p.median_mm, p.p90_mm);
  }
  return text;
}

}  // namespace

int replay(const ReplayOptions& options) {
  const auto summary = run(options);
  if (!summary) return report(summary.error());
  fmt::print("{}", options.json ? to_json(*summary).dump(2) + "\n" : to_text(*summary));
  return 0;
}

}  // namespace sightline::cli
