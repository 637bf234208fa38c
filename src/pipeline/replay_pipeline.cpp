// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/replay_pipeline.hpp"

#include <algorithm>
#include <ctime>

#include "sightline/base/log.hpp"
#include "sightline/base/time.hpp"
#include "sightline/image/convert.hpp"
#include "sightline/pipeline/calibration_proposal.hpp"

namespace sightline {
namespace {

constexpr double kDefaultRate = 30;

bool is_told(CalibrationState state) {
  return is_wrong(state) || state == CalibrationState::kDisputed ||
         state == CalibrationState::kUnfit;
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

}  // namespace

Result<std::unique_ptr<ReplayPipeline>> ReplayPipeline::create(
    const Installation& installation, std::shared_ptr<const Recording> recording,
    PoseLogWriter* log, const ReplayOutputs& outputs, const SearchTiming& search_timing) {
  std::unique_ptr<ReplayPipeline> pipeline(new ReplayPipeline());
  SL_ASSIGN(pipeline->rig_, load_rig(installation));
  for (const auto* folder : {&outputs.video, &outputs.png}) {
    if (!folder->empty()) SL_RETURN_IF_ERROR(make_folder(*folder));
  }
  pipeline->boxes_ = moving_boxes(pipeline->rig_);
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
  pipeline->summary_.search_timing = search_timing;
  SL_RETURN_IF_ERROR(pipeline->make_chain(installation));
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

Status ReplayPipeline::make_chain(const Installation& installation) {
  std::vector<CameraId> observing;
  for (const auto& camera : cameras_) {
    if (camera && camera->observes) observing.push_back(camera->id);
  }
  SL_ASSIGN(auto search, ObjectSearch::create(installation, rig_));
  SL_ASSIGN(chain_, TrackingChain::create(installation, rig_, observing, std::move(search),
                                          summary_.search_timing));
  return {};
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
  camera.observes = observes(config->role);
  if (config->axes_by_picture) camera.refiner = AngleRefiner::create(config->calibration);
  if (camera.observes) {
    SL_ASSIGN(camera.learner, make_learner(installation, rig_, camera.id));
  }
  const bool drawn = !outputs.video.empty() || !outputs.png.empty();
  if (drawn && streams(config->role)) {
    SL_ASSIGN(camera.renderer, make_renderer(installation, rig_, camera.id));
    camera.pool = std::make_unique<ImagePool>(recorded.width, recorded.height);
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
  take(frames);
  const double start = process_cpu_ms();
  chain_->begin(frames.front()->info().capture);
  const double begun = process_cpu_ms();
  for (const CameraFrame& seen : frames_) {
    if (seen.frame->info().status != FrameStatus::kDamaged) chain_->observe(seen);
  }
  const double observed = process_cpu_ms();
  if (!frames_.empty() && chain_->search(frames_)) ++summary_.searches;
  const double searched = process_cpu_ms();
  SL_RETURN_IF_ERROR(fuse());
  summary_.observe_cpu_ms += observed - begun;
  summary_.search_cpu_ms += begun - start + searched - observed;
  summary_.search_time_ms = 1e3 * to_seconds(chain_->search_time());
  summary_.fuse_cpu_ms += process_cpu_ms() - searched;
  summary_.frames += frames.size();
  ++summary_.sets;
  learn(set_);
  if (collector_) collect_points();
  return draw(set_);
}

void ReplayPipeline::take(const std::vector<FramePtr>& frames) {
  frames_.clear();
  set_.clear();
  for (const FramePtr& frame : frames) {
    auto& camera = cameras_[frame->info().camera.index()];
    set_.push_back(camera && camera->refiner ? refine(frame, *camera) : frame);
    if (camera) frames_.push_back({camera->id, set_.back()});
  }
}

FramePtr ReplayPipeline::refine(const FramePtr& frame, Camera& camera) {
  const double start = process_cpu_ms();
  FramePtr out = camera.refiner->step(frame, tracks(), boxes_);
  summary_.turn_cpu_ms += process_cpu_ms() - start;
  ++summary_.turned_frames;
  ++camera.asked;
  camera.refined += camera.refiner->status().verdict == RefinerVerdict::kUsed ? 1 : 0;
  if (const auto news = camera.refiner->news()) {
    log::warning("at {:.1f} s: {}", to_seconds(frame->info().capture.time_since_epoch()), *news);
  }
  return out;
}

const RefinerStatus* ReplayPipeline::refiner(size_t camera) const {
  const auto& recorded = cameras_.at(camera);
  return recorded && recorded->refiner ? &recorded->refiner->status() : nullptr;
}

// After fusion, so that a frame is judged and drawn with its own pose.
void ReplayPipeline::learn(const std::vector<FramePtr>& frames) {
  const double start = process_cpu_ms();
  for (const FramePtr& frame : frames) {
    const auto& camera = cameras_[frame->info().camera.index()];
    if (camera && camera->learner) camera->learner->step(*frame, tracks());
  }
  summary_.learn_cpu_ms += process_cpu_ms() - start;
}

OcclusionDepthPtr ReplayPipeline::hidden(size_t camera) const {
  const auto& recorded = cameras_.at(camera);
  return recorded && recorded->learner ? recorded->learner->hidden() : nullptr;
}

Status ReplayPipeline::fuse() {
  Time now{};
  for (const UpdateReport& report : chain_->fuse()) {
    now = std::max(now, report.estimate.time);
    const std::string& object = rig_.objects[report.estimate.object.index()].named.name;
    ++summary_.rows_by_state[object][std::string(to_string(report.estimate.state))];
    if (log_ == nullptr) continue;
    SL_RETURN_IF_ERROR(log_->append(make_pose_log_row(report.estimate, object, camera_names_)));
  }
  if (chain_->has_verdict()) tell_verdicts(*chain_->fusion().watch(), now);
  return {};
}

void ReplayPipeline::tell_verdicts(const CalibrationWatch& watch, Time now) {
  verdicts_.resize(watch.cameras().size());
  unfit_.resize(verdicts_.size());
  for (size_t i = 0; i < verdicts_.size(); ++i) {
    const CameraWatch& camera = watch.cameras()[i];
    const CalibrationState before = verdicts_[i];
    // Nothing is known for a while of one that is put back; then it is in order again.
    if (camera.state != CalibrationState::kUnknown) verdicts_[i] = camera.state;
    const bool again = camera.state == CalibrationState::kInOrder &&
                       (is_wrong(before) || before == CalibrationState::kUnfit);
    if (camera.state == CalibrationState::kUnfit) {
      std::string words = unfit_words(camera_names_, watch.cameras(), i);
      if (words == unfit_[i]) continue;
      log::warning("at {:.1f} s: camera {}: {}", to_seconds(now.time_since_epoch()),
                   camera_names_[i], words);
      unfit_[i] = std::move(words);
      continue;
    }
    unfit_[i].clear();
    if (camera.state == before || !(again || is_told(camera.state))) continue;
    log::warning("at {:.1f} s: camera {}: {} since {:.1f} s: {}",
                 to_seconds(now.time_since_epoch()), camera_names_[i], to_string(camera.state),
                 to_seconds(camera.since.time_since_epoch()), correction_words(camera));
  }
}

void ReplayPipeline::collect_points() {
  std::vector<CameraFrame> observed;
  for (const CameraFrame& seen : frames_) {
    if (chain_->observer(seen.camera) != nullptr) observed.push_back(seen);
  }
  collector_->step(observed, tracks());
}

Status ReplayPipeline::draw(const std::vector<FramePtr>& frames) {
  for (const FramePtr& frame : frames) {
    auto& camera = cameras_[frame->info().camera.index()];
    if (camera && camera->renderer) SL_RETURN_IF_ERROR(draw_one(*frame, *camera));
  }
  return {};
}

Status ReplayPipeline::draw_one(const Frame& frame, Camera& camera) {
  const auto image = camera.pool->get();
  copy_i420(frame.i420(), image->mutable_view());
  const OcclusionDepthPtr hidden = camera.learner ? camera.learner->hidden() : nullptr;
  camera.renderer->draw(image->mutable_view(), frame.info().capture, tracks(), poses_,
                        {hidden.get(), {}, frame.info().place.get()});
  if (collector_) {
    collector_->marks(camera.id, frame.info().capture, marks_);
    draw_point_marks(image->mutable_view(), marks_, fit_depth_scale(marks_), kManyPoints);
  }
  if (camera.video) {
    SL_RETURN_IF_ERROR(camera.video->append(image->view(), frame.info().capture));
  }
  if (!png_folder_.empty()) {
    const std::string name = fmt::format("{}_{:05}.png", camera.name, camera.drawn);
    SL_RETURN_IF_ERROR(write_png(png_folder_ / name, image->view()));
  }
  ++camera.drawn;
  return {};
}

Status ReplayPipeline::finish() {
  for (auto& camera : cameras_) {
    if (camera && camera->video) SL_RETURN_IF_ERROR(camera->video->close());
    if (!camera || !camera->refiner) continue;
    summary_.turns.push_back(
        {camera->name, camera->asked, camera->refined, camera->refiner->status()});
  }
  if (collector_) {
    summary_.points = collector_->summary();
    if (!points_file_.empty()) SL_RETURN_IF_ERROR(collector_->write(points_file_));
  }
  return log_ != nullptr ? log_->close() : Status();
}

}  // namespace sightline
