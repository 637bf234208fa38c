// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "progress.hpp"
#include "replay_pipeline.hpp"
#include "report.hpp"
#include "sightline/base/log.hpp"

namespace sightline::cli {
namespace {

using namespace std::chrono_literals;

constexpr Duration kLately = 300ms;
constexpr Duration kPointsFrom = 100ms;  // before the time of a single picture

std::optional<Eigen::Vector3d> to_point(const std::vector<double>& numbers) {
  if (numbers.size() != 3) return std::nullopt;
  return Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
}

// The view that is asked for: one of the installation's, or the default with what was said.
Result<ViewConfig> choose_view(const ViewOptions& options, const Installation& installation) {
  std::vector<CalibratedCamera> cameras;
  for (const CameraConfig& camera : installation.cameras) cameras.push_back(camera.calibration);
  if (!options.name.empty()) {
    for (const ViewConfig& view : installation.views) {
      if (view.name == options.name) return view;
    }
    return make_error(ErrorCode::kInvalidInput, installation.file.string(),
                      "has no [[view]] named '{}'", options.name);
  }
  ViewPoint point;
  point.eye = to_point(options.eye);
  point.target = to_point(options.target);
  if (const auto up = to_point(options.up)) point.up = *up;
  point.fov_deg = options.fov_deg;
  point.width = options.width;
  point.height = options.height;
  SL_ASSIGN(const CalibratedCamera camera, make_view_camera(point, cameras, "view", "view"));
  return ViewConfig{
      .name = "view", .point = point, .overlay = free_view_style({}), .view = camera, .where = ""};
}

/// Takes the pictures of a replay in one view, into a video or the last one into a PNG.
class Film {
 public:
  static Result<std::unique_ptr<Film>> create(const ViewOptions& options,
                                              const Installation& installation, const Rig& rig,
                                              double rate_hz) {
    std::unique_ptr<Film> film(new Film(options.out));
    SL_ASSIGN(const ViewConfig config, choose_view(options, installation));
    SL_ASSIGN(film->view_, make_view(installation, rig, config));
    film->picture_ = std::make_unique<Picture>(film->view_->width(), film->view_->height());
    film->cameras_ = installation.cameras.size();
    if (options.out.extension() == ".mkv") {
      SL_ASSIGN(film->video_,
                OverlayVideoWriter::create(options.out,
                                           {film->view_->width(), film->view_->height(), rate_hz}));
    }
    return film;
  }

  bool is_video() const { return video_ != nullptr; }

  Status take(Time time, const ReplayPipeline& pipeline) {
    const std::vector<bool> present(cameras_, true);
    const auto& tracks = pipeline.tracks();
    const ScenePointsPtr points = pipeline.points_at(time);
    view_->draw(picture_->mutable_view(), time, tracks,
                viewed_states(tracks, time, kLately, present), points.get(), poses_);
    ++pictures_;
    return video_ ? video_->append(picture_->view(), time) : Status();
  }

  Status finish() {
    if (video_) return video_->close();
    return write_png(out_, picture_->view());
  }
  size_t pictures() const { return pictures_; }

 private:
  explicit Film(std::filesystem::path out) : out_(std::move(out)) {}
  std::filesystem::path out_;
  std::unique_ptr<FreeView> view_;
  std::unique_ptr<Picture> picture_;
  std::unique_ptr<OverlayVideoWriter> video_;
  size_t cameras_ = 0;
  size_t pictures_ = 0;
  std::vector<PoseAt> poses_;
};

Result<size_t> run(const ViewOptions& options) {
  const auto extension = options.out.extension();
  if (extension != ".png" && extension != ".mkv") {
    return make_error(ErrorCode::kInvalidInput, options.out.string(),
                      "is neither a .png (one picture) nor a .mkv (the whole recording)");
  }
  SL_ASSIGN(Recording opened, open_recording(options.recording));
  for (const std::string& warning : opened.warnings) log::warning("{}", warning);
  const auto recording = std::make_shared<const Recording>(std::move(opened));
  SL_ASSIGN(const Installation installation, options.config.empty()
                                                 ? recording_installation(options.recording)
                                                 : read_installation(options.config));
  SL_ASSIGN(auto pipeline, ReplayPipeline::create(installation, recording, nullptr, {}));
  const Duration period = recording->cameras.front().frame_period();
  SL_ASSIGN(auto film, Film::create(options, installation, pipeline->rig(),
                                    period > Duration(0) ? 1 / to_seconds(period) : 30));
  SL_ASSIGN(auto replay, VirtualReplay::open(recording));
  ProgressBar bar("view", recording->frame_count());
  std::optional<Time> start;
  Time last{}, drawn{};
  for (;;) {
    SL_ASSIGN(const auto frames, replay->next());
    if (!frames) break;
    const Time now = frames->front()->info().capture;
    if (!start) start = now;
    if (options.at_s && now - *start > from_seconds(*options.at_s)) break;
    // A single picture needs the points of its own time only.
    const Time end =
        options.at_s ? *start + from_seconds(*options.at_s) : recording->last_capture();
    if (installation.points.enabled && (film->is_video() || now >= end - kPointsFrom)) {
      pipeline->want_points(installation);
    }
    SL_RETURN_IF_ERROR(pipeline->step(*frames));
    last = now;
    // Free-running cameras: a picture for every period of one, not for every frame of all.
    if (film->is_video() && (drawn == Time{} || now - drawn >= period * 9 / 10)) {
      SL_RETURN_IF_ERROR(film->take(now, *pipeline));
      drawn = now;
    }
    bar.set(pipeline->summary().frames);
  }
  if (!start) {
    return make_error(ErrorCode::kInvalidInput, options.recording.string(), "has no frames");
  }
  if (!film->is_video()) SL_RETURN_IF_ERROR(film->take(last, *pipeline));
  SL_RETURN_IF_ERROR(film->finish());
  return film->pictures();
}

}  // namespace

int view(const ViewOptions& options) {
  const auto pictures = run(options);
  if (!pictures) return report(pictures.error());
  if (options.json) {
    const nlohmann::ordered_json json{{"out", options.out.string()}, {"pictures", *pictures}};
    fmt::print("{}\n", json.dump(2));
  } else {
    fmt::print("{}: {} picture{}\n", options.out.string(), *pictures, *pictures == 1 ? "" : "s");
  }
  return 0;
}

}  // namespace sightline::cli
