// SPDX-License-Identifier: Apache-2.0
#include "replay_pipeline.hpp"

#include <algorithm>
#include <ctime>

#include "object_views.hpp"
#include "sightline/base/log.hpp"
#include "sightline/image/convert.hpp"

namespace sightline::cli {
namespace {

constexpr double kDefaultRate = 30;

// CPU time for the summary only; nothing that is computed depends on it.
double cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

Status make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!error) return {};
  return make_error(ErrorCode::kIo, folder.string(), "cannot make the folder: {}", error.message());
}

double rate_of(const RecordedCamera& camera) {
  const double period = to_seconds(camera.frame_period());
  return period > 0 ? 1 / period : kDefaultRate;
}

Observation unseen(ObjectId object, const Frame& frame, CameraId camera) {
  Observation observation;
  observation.object = object;
  observation.camera = camera;
  observation.epoch = frame.info().epoch;
  observation.sequence = frame.info().sequence;
  observation.capture = frame.info().capture;
  return observation;
}

}  // namespace

Result<std::unique_ptr<ReplayPipeline>> ReplayPipeline::create(
    const Installation& installation, std::shared_ptr<const Recording> recording,
    PoseLogWriter* log, const ReplayOutputs& outputs) {
  std::unique_ptr<ReplayPipeline> pipeline(new ReplayPipeline());
  SL_ASSIGN(pipeline->rig_, load_rig(installation));
  for (const RigObject& object : pipeline->rig_.objects) {
    SL_ASSIGN(ObjectEstimator estimator,
              ObjectEstimator::create(installation.estimator, object.named.id, object.lookalikes));
    pipeline->tracks_.push_back(estimator.track());
    pipeline->estimators_.push_back(std::move(estimator));
  }
  for (const auto* folder : {&outputs.video, &outputs.png}) {
    if (!folder->empty()) SL_RETURN_IF_ERROR(make_folder(*folder));
  }
  SL_ASSIGN(pipeline->search_, ObjectSearch::create(installation, pipeline->rig_, cache_folder()));
  for (const CameraConfig& camera : installation.cameras) {
    pipeline->camera_names_.push_back(camera.name);
  }
  for (const RecordedCamera& recorded : recording->cameras) {
    SL_RETURN_IF_ERROR(pipeline->add_camera(installation, recorded, outputs));
  }
  const auto used = std::count_if(pipeline->cameras_.begin(), pipeline->cameras_.end(),
                                  [](const auto& camera) { return camera.has_value(); });
  if (used == 0) {
    return make_error(ErrorCode::kInvalidInput, installation.file.string(),
                      "names none of the recording's cameras ({})", recording->path.string());
  }
  pipeline->log_ = log;
  pipeline->png_folder_ = outputs.png;
  pipeline->points_file_ = outputs.points;
  const bool shown =
      installation.points.overlay && (!outputs.video.empty() || !outputs.png.empty());
  if (!outputs.points.empty() || shown) {
    pipeline->want_points(installation);
  }
  return pipeline;
}

void ReplayPipeline::want_points(const Installation& installation) {
  if (!collector_) collector_ = std::make_unique<PointCollector>(installation, rig_);
}

ScenePointsPtr ReplayPipeline::points_at(Time time) const {
  return collector_ ? collector_->points_at(time) : nullptr;
}

Status ReplayPipeline::add_camera(const Installation& installation, const RecordedCamera& recorded,
                                  const ReplayOutputs& outputs) {
  cameras_.emplace_back();
  const auto& configs = installation.cameras;
  const auto config = std::find_if(configs.begin(), configs.end(), [&](const CameraConfig& c) {
    return c.recorded_as == recorded.name || (c.recorded_as.empty() && c.name == recorded.name);
  });
  if (config == configs.end()) {
    log::warning("{}: not in {}, left out", recorded.name, installation.file.string());
    return {};
  }
  Camera camera;
  camera.id = CameraId(static_cast<uint32_t>(config - configs.begin()));
  camera.name = config->name;
  if (observes(config->role)) {
    SL_ASSIGN(camera.observer, CameraObserver::create(installation, rig_, camera.id));
  }
  if (camera.observer) {
    SL_ASSIGN(camera.learner, make_learner(installation, rig_, camera.id));
  }
  const bool drawn = !outputs.video.empty() || !outputs.png.empty();
  if (drawn && streams(config->role)) {
    SL_ASSIGN(camera.renderer, make_renderer(installation, rig_, camera.id));
    camera.pool = std::make_unique<PicturePool>(recorded.width, recorded.height);
    if (!outputs.video.empty()) {
      SL_ASSIGN(camera.video,
                OverlayVideoWriter::create(outputs.video / (camera.name + ".mkv"),
                                           {recorded.width, recorded.height, rate_of(recorded)}));
    }
  }
  cameras_.back() = std::move(camera);
  return {};
}

Status ReplayPipeline::step(const std::vector<FramePtr>& frames) {
  const double start = cpu_ms();
  observe(frames);
  const double observed = cpu_ms();
  if (search_) search(frames);
  const double searched = cpu_ms();
  SL_RETURN_IF_ERROR(fuse());
  summary_.observe_cpu_ms += observed - start;
  summary_.search_cpu_ms += searched - observed;
  summary_.fuse_cpu_ms += cpu_ms() - searched;
  summary_.frames += frames.size();
  ++summary_.sets;
  learn(frames);
  if (collector_) collect_points(frames);
  return draw(frames);
}

// After fusion, so that a frame is judged and drawn with its own pose.
void ReplayPipeline::learn(const std::vector<FramePtr>& frames) {
  const double start = cpu_ms();
  for (const FramePtr& frame : frames) {
    const auto& camera = cameras_[frame->info().camera.index()];
    if (camera && camera->learner) camera->learner->step(*frame, tracks_);
  }
  summary_.learn_cpu_ms += cpu_ms() - start;
}

HiddenDepthPtr ReplayPipeline::hidden(size_t camera) const {
  const auto& recorded = cameras_.at(camera);
  return recorded && recorded->learner ? recorded->learner->hidden() : nullptr;
}

void ReplayPipeline::observe(const std::vector<FramePtr>& frames) {
  observations_.clear();
  for (const FramePtr& frame : frames) {
    const auto& camera = cameras_[frame->info().camera.index()];
    if (!camera || frame->info().status == FrameStatus::kDamaged) continue;
    const size_t first = observations_.size();
    if (camera->observer) camera->observer->step(*frame, tracks_, observations_);
    for (size_t i = first; i < observations_.size(); ++i) observations_[i].camera = camera->id;
    // Objects that nothing can measure yet still have their row.
    for (const RigObject& object : rig_.objects) {
      const bool seen =
          std::any_of(observations_.begin() + static_cast<ptrdiff_t>(first), observations_.end(),
                      [&](const Observation& made) { return made.object == object.named.id; });
      if (!seen) observations_.push_back(unseen(object.named.id, *frame, camera->id));
    }
  }
}

// In the recording's time a search takes no time at all.
void ReplayPipeline::search(const std::vector<FramePtr>& frames) {
  for (const FramePtr& frame : frames) {
    const auto& camera = cameras_[frame->info().camera.index()];
    if (camera && camera->observer) search_->add_frame(camera->id, *frame, tracks_);
  }
  const Time now = frames.front()->info().capture;
  if (!search_->due(now, tracks_)) return;
  ++summary_.searches;
  for (Observation& found : search_->search(now, tracks_)) {
    if (found.capture != now) {
      const size_t object = found.object.index();
      estimators_[object].process({&found, 1});
      tracks_[object] = estimators_[object].track();
      continue;
    }
    for (Observation& known : observations_) {
      const bool same = known.object == found.object && known.camera == found.camera;
      if (same && known.terms.empty()) known = found;
    }
  }
}

Status ReplayPipeline::fuse() {
  for (const RigObject& object : rig_.objects) {
    set_.clear();
    for (const Observation& observation : observations_) {
      if (observation.object == object.named.id) set_.push_back(observation);
    }
    if (set_.empty()) continue;
    ObjectEstimator& estimator = estimators_[object.named.id.index()];
    const UpdateReport report = estimator.process(set_);
    tracks_[object.named.id.index()] = estimator.track();
    ++summary_.rows_by_state[object.named.name][std::string(to_string(report.estimate.state))];
    if (log_ == nullptr) continue;
    SL_RETURN_IF_ERROR(
        log_->append(make_pose_log_row(report.estimate, object.named.name, camera_names_)));
  }
  return {};
}

void ReplayPipeline::collect_points(const std::vector<FramePtr>& frames) {
  std::vector<std::pair<CameraId, FramePtr>> seen;
  for (const FramePtr& frame : frames) {
    const auto& camera = cameras_[frame->info().camera.index()];
    if (camera && camera->observer) seen.emplace_back(camera->id, frame);
  }
  collector_->step(seen, tracks_);
}

Status ReplayPipeline::draw(const std::vector<FramePtr>& frames) {
  for (const FramePtr& frame : frames) {
    auto& camera = cameras_[frame->info().camera.index()];
    if (camera && camera->renderer) SL_RETURN_IF_ERROR(draw_one(*frame, *camera));
  }
  return {};
}

Status ReplayPipeline::draw_one(const Frame& frame, Camera& camera) {
  const auto picture = camera.pool->get();
  copy_i420(frame.i420(), picture->mutable_view());
  const HiddenDepthPtr hidden = camera.learner ? camera.learner->hidden() : nullptr;
  camera.renderer->draw(picture->mutable_view(), frame.info().capture, tracks_, poses_,
                        {hidden.get()});
  if (collector_) {
    collector_->marks(camera.id, frame.info().capture, marks_);
    draw_point_marks(picture->mutable_view(), marks_, fit_depth_scale(marks_), kManyPoints);
  }
  if (camera.video) {
    SL_RETURN_IF_ERROR(camera.video->append(picture->view(), frame.info().capture));
  }
  if (!png_folder_.empty()) {
    const std::string name = fmt::format("{}_{:05}.png", camera.name, camera.drawn);
    SL_RETURN_IF_ERROR(write_png(png_folder_ / name, picture->view()));
  }
  ++camera.drawn;
  return {};
}

Status ReplayPipeline::finish() {
  for (auto& camera : cameras_) {
    if (camera && camera->video) SL_RETURN_IF_ERROR(camera->video->close());
  }
  if (collector_) {
    summary_.points = collector_->summary();
    if (!points_file_.empty()) SL_RETURN_IF_ERROR(collector_->write(points_file_));
  }
  return log_ != nullptr ? log_->close() : Status();
}

}  // namespace sightline::cli
