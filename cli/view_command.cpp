// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "commands.hpp"
#include "progress.hpp"
#include "report.hpp"
#include "sightline/base/log.hpp"
#include "sightline/pipeline/replay_library.hpp"
#include "sightline/pipeline/replay_pipeline.hpp"

namespace sightline::cli {
namespace {

struct ViewCommandOptions {
  std::filesystem::path recording;
  std::filesystem::path config;  ///< empty: what the recording says
  std::filesystem::path out;     ///< .png or .mkv
  std::string name;              ///< of a [[virtual_camera]] in the installation; empty: as follows
  std::vector<double> eye, target, up;  ///< empty or 3 numbers [m]
  double fov_deg = 50;
  int width = 1280, height = 720;
  std::optional<double> at_s;  ///< since the start of the recording; unset: to its end
  bool json = false;
};

using namespace std::chrono_literals;

constexpr Duration kLately = 300ms;
constexpr Duration kPointsFrom = 100ms;  // before the time of a single image

std::optional<Eigen::Vector3d> to_point(const std::vector<double>& numbers) {
  if (numbers.size() != 3) return std::nullopt;
  return Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
}

// The view that is asked for: one of the installation's, or the default with what was said.
Result<VirtualCameraConfig> choose_view(const ViewCommandOptions& options,
                                        const Installation& installation) {
  std::vector<CalibratedCamera> cameras;
  for (const CameraConfig& camera : installation.cameras) cameras.push_back(camera.calibration);
  if (!options.name.empty()) {
    for (const VirtualCameraConfig& view : installation.virtual_cameras) {
      if (view.name == options.name) return view;
    }
    return make_error(ErrorCode::kInvalidInput, installation.file.string(),
                      "has no [[virtual_camera]] named '{}'", options.name);
  }
  ViewPoint point;
  point.eye = to_point(options.eye);
  point.target = to_point(options.target);
  if (const auto up = to_point(options.up)) point.up = *up;
  point.fov_deg = options.fov_deg;
  point.width = options.width;
  point.height = options.height;
  SL_ASSIGN(const CalibratedCamera camera, make_view_camera(point, cameras, "view", "view"));
  return VirtualCameraConfig{.name = "view",
                             .point = point,
                             .overlay = virtual_camera_style({}),
                             .view = camera,
                             .place = {}};
}

/// Takes the images of a replay in one view, into a video or the last one into a PNG.
class ViewWriter {
 public:
  static Result<std::unique_ptr<ViewWriter>> create(const ViewCommandOptions& options,
                                                    const Installation& installation,
                                                    const Rig& rig, double rate_hz) {
    std::unique_ptr<ViewWriter> writer(new ViewWriter(options.out));
    SL_ASSIGN(const VirtualCameraConfig config, choose_view(options, installation));
    SL_ASSIGN(writer->view_, make_view(installation, rig, config));
    writer->image_ = std::make_unique<Image>(writer->view_->width(), writer->view_->height());
    writer->cameras_ = installation.cameras.size();
    if (options.out.extension() == ".mkv") {
      SL_ASSIGN(writer->video_,
                OverlayVideoWriter::create(
                    options.out, {writer->view_->width(), writer->view_->height(), rate_hz}));
    }
    return writer;
  }

  bool is_video() const { return video_ != nullptr; }

  Status take(Time time, const ReplayPipeline& pipeline) {
    const std::vector<bool> present(cameras_, true);
    const auto& tracks = pipeline.tracks();
    const ScenePointsPtr points = pipeline.points_at(time);
    view_->draw(image_->mutable_view(), time, tracks, viewed_states(tracks, time, kLately, present),
                points.get(), poses_);
    ++images_;
    return video_ ? video_->append(image_->view(), time) : Status();
  }

  Status finish() {
    if (video_) return video_->close();
    return write_png(out_, image_->view());
  }
  size_t images() const { return images_; }

 private:
  explicit ViewWriter(std::filesystem::path out) : out_(std::move(out)) {}
  std::filesystem::path out_;
  std::unique_ptr<VirtualCamera> view_;
  std::unique_ptr<Image> image_;
  std::unique_ptr<OverlayVideoWriter> video_;
  size_t cameras_ = 0;
  size_t images_ = 0;
  std::vector<PoseAt> poses_;
};

Result<size_t> run(const ViewCommandOptions& options) {
  const auto extension = options.out.extension();
  if (extension != ".png" && extension != ".mkv") {
    return make_error(ErrorCode::kInvalidInput, options.out.string(),
                      "is neither a .png (one image) nor a .mkv (the whole recording)");
  }
  SL_ASSIGN(Recording opened, open_recording(options.recording));
  for (const std::string& warning : opened.warnings) log::warning("{}", warning);
  const auto recording = std::make_shared<const Recording>(std::move(opened));
  SL_ASSIGN(const Installation installation, options.config.empty()
                                                 ? recording_installation(options.recording)
                                                 : read_installation(options.config));
  SL_ASSIGN(auto pipeline, ReplayPipeline::create(installation, recording, nullptr, {}));
  const Duration period = recording->cameras.front().frame_period();
  SL_ASSIGN(auto writer, ViewWriter::create(options, installation, pipeline->rig(),
                                            period > Duration(0) ? 1 / to_seconds(period) : 30));
  SL_ASSIGN(auto replay, VirtualReplay::open(recording, {}, time_offsets(*recording, installation),
                                             axis_histories(*recording, installation)));
  ProgressBar bar("view", recording->frame_count());
  std::optional<Time> start;
  Time last{}, drawn{};
  for (;;) {
    SL_ASSIGN(const auto frames, replay->next());
    if (!frames) break;
    const Time now = frames->front()->info().capture;
    if (!start) start = now;
    if (options.at_s && now - *start > from_seconds(*options.at_s)) break;
    // A single image needs the points of its own time only.
    const Time end =
        options.at_s ? *start + from_seconds(*options.at_s) : recording->last_capture();
    if (installation.points.enabled && (writer->is_video() || now >= end - kPointsFrom)) {
      pipeline->want_points(installation);
    }
    SL_RETURN_IF_ERROR(pipeline->step(*frames));
    last = now;
    // Free-running cameras: an image for every period of one, not for every frame of all.
    if (writer->is_video() && (drawn == Time{} || now - drawn >= period * 9 / 10)) {
      SL_RETURN_IF_ERROR(writer->take(now, *pipeline));
      drawn = now;
    }
    bar.set(pipeline->summary().frames);
  }
  if (!start) {
    return make_error(ErrorCode::kInvalidInput, options.recording.string(), "has no frames");
  }
  if (!writer->is_video()) SL_RETURN_IF_ERROR(writer->take(last, *pipeline));
  SL_RETURN_IF_ERROR(writer->finish());
  return writer->images();
}

int view(const ViewCommandOptions& options) {
  const auto images = run(options);
  if (!images) return report(images.error());
  if (options.json) {
    const nlohmann::ordered_json json{{"out", options.out.string()}, {"images", *images}};
    fmt::print("{}\n", json.dump(2));
  } else {
    fmt::print("{}: {} image{}\n", options.out.string(), *images, *images == 1 ? "" : "s");
  }
  return 0;
}

}  // namespace

void add_view(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<ViewCommandOptions>();
  auto* command = app.add_subcommand("view", "the rig of a recording, seen from anywhere");
  command->add_option("RECORDING", options->recording, "recording folder")->required();
  command->add_option("--out", options->out, "FILE.png (one image) or FILE.mkv (all of it)")
      ->required();
  command->add_option("--config", options->config, "installation file (default: the recording)");
  auto* name = command->add_option("--view", options->name,
                                   "name of a [[virtual_camera]] of the installation");
  for (const auto& [option, numbers, text] :
       {std::tuple("--eye", &options->eye, "where to look from, x y z in the world"),
        std::tuple("--target", &options->target,
                   "what to look at (default: where the cameras look)"),
        std::tuple("--up", &options->up, "what is upwards (default 0 0 1)")}) {
    command->add_option(option, *numbers, text)->expected(3)->excludes(name);
  }
  command->add_option("--fov", options->fov_deg, "horizontal, degrees (default 50)")
      ->excludes(name);
  command->add_option("--width", options->width, "default 1280")->excludes(name);
  command->add_option("--height", options->height, "default 720")->excludes(name);
  command
      ->add_option("--at", options->at_s, "seconds since the recording's start (default: its end)")
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--json", options->json, "as JSON");
  command->callback([options, &chosen] { chosen = [options] { return view(*options); }; });
}

}  // namespace sightline::cli
