// SPDX-License-Identifier: Apache-2.0
#include "system/system_exchange.hpp"

#include <algorithm>
#include <set>

#include "sightline/pipeline/calibration_proposal.hpp"
#include "system/system_status.hpp"

namespace sightline {
namespace {

bool same_images(const EncoderOptions& a, const EncoderOptions& b) {
  return a.width == b.width && a.height == b.height && a.rate_hz == b.rate_hz;
}

std::set<std::string> camera_names(const Installation& installation) {
  std::set<std::string> names;
  for (const CameraConfig& camera : installation.cameras) names.insert(camera.name);
  for (const VirtualCameraConfig& view : installation.virtual_cameras) names.insert(view.name);
  return names;
}

std::set<std::string> stream_names(const Installation& installation) {
  std::set<std::string> names;
  if (!installation.rtsp.enabled) return names;
  for (const CameraConfig& camera : installation.cameras) {
    if (streams(camera.role)) names.insert(camera.name);
  }
  for (const VirtualCameraConfig& view : installation.virtual_cameras) names.insert(view.name);
  return names;
}

std::set<std::string> object_names(const Installation& installation) {
  std::set<std::string> names;
  for (const ObjectConfig& object : installation.objects) names.insert(object.description.name);
  return names;
}

void remove_gone(Registry& registry, const char* label, const std::set<std::string>& before,
                 const std::set<std::string>& now) {
  for (const std::string& name : before) {
    if (!now.contains(name)) registry.remove(label, name);
  }
}

}  // namespace

void remove_metrics(Registry& registry, const Installation& gone, const Installation& stays) {
  remove_gone(registry, "camera", camera_names(gone), camera_names(stays));
  remove_gone(registry, "object", object_names(gone), object_names(stays));
}

Status SystemExchange::acquire() {
  if (draft_.plan.recorder) {
    next_.recorder.reset();
    if (draft_.recorder) {
      SL_ASSIGN(next_.recorder, RecorderWorker::start(*std::move(draft_.recorder),
                                                      context_.registry, context_.beats));
    }
  }
  const bool http_moves = next_.installation.http.enabled && !next_.http;
  SL_RETURN_IF_ERROR(hand_over_http());
  const Status done = hand_over_rtsp();
  if (!done && http_moves) {  // the other way round again
    next_.http->stop();
    old_is_whole_ = static_cast<bool>(old_.http->resume()) && old_is_whole_;
  }
  return done;
}

Status SystemExchange::switch_over() {
  // Whose views those are is known by CameraId.
  const bool same_cameras =
      std::ranges::equal(old_.installation.cameras, next_.installation.cameras, {},
                         &CameraConfig::name, &CameraConfig::name);
  if (!same_cameras) context_.taps->targets.publish(nullptr);
  // Estimates and frames of the old numbering are not for the new recording.
  if (draft_.plan.recorder) context_.taps->recorder.publish(nullptr);
  if (draft_.plan.search) context_.taps->search.publish(nullptr);
  if (draft_.plan.cell) context_.taps->cell.publish(nullptr);
  if (draft_.plan.points) context_.taps->points.publish(nullptr);
  stop_leaving();
  exchange_stages();
  if (old_.fusion && next_.fusion != old_.fusion) old_.fusion->stop();
  rename_poses();
  start_cell();
  SL_RETURN_IF_ERROR(move_streams());
  SL_RETURN_IF_ERROR(start_cameras());
  start_following();
  SL_RETURN_IF_ERROR(start_views());
  context_.taps->recorder.publish(next_.recorder);
  start_search();
  start_actions();
  start_mqtt();
  keep_last_poses();
  watch_calibration();
  return {};
}

Status SystemExchange::hand_over_http() {
  if (!next_.installation.http.enabled || next_.http) return {};
  old_.http->stop();
  auto made = HttpService::start(next_.installation.http.server, context_.http);
  if (!made) {
    old_is_whole_ = static_cast<bool>(old_.http->resume());
    return made.error();
  }
  next_.http = *std::move(made);
  return {};
}

Status SystemExchange::hand_over_rtsp() {
  if (!next_.installation.rtsp.enabled || next_.rtsp) return {};
  old_.rtsp->stop();
  auto made = RtspService::start(next_.installation.rtsp.server, context_.beats);
  if (!made) {
    old_is_whole_ = static_cast<bool>(resume_rtsp());
    return made.error();
  }
  next_.rtsp = *std::move(made);
  return {};
}

Status SystemExchange::resume_rtsp() {
  SL_RETURN_IF_ERROR(old_.rtsp->resume());
  const auto add = [this](const auto& worker) -> Status {
    if (!worker->output()) return {};
    const EncoderOptions& images = worker->output()->options();
    SL_ASSIGN(auto stream, old_.rtsp->server().add_stream(
                               worker->name(), {images.width, images.height, images.rate_hz}));
    worker->output()->move_to(std::move(stream));
    return {};
  };
  for (const auto& worker : old_.cameras) SL_RETURN_IF_ERROR(add(worker));
  for (const auto& worker : old_.views) SL_RETURN_IF_ERROR(add(worker));
  return {};
}

// Streams whose images go on in the same size keep their viewers.
void SystemExchange::keep_output(const std::shared_ptr<StreamOutput>& output,
                                 const std::string& name, bool ends) {
  if (!output) return;
  if (!ends) {
    outputs_[name] = output;
    return;
  }
  output->close();
  if (old_.rtsp && server_stays()) old_.rtsp->server().remove_stream(name);
}

void SystemExchange::stop_leaving() {
  const std::set<std::string> stay = stream_names(next_.installation);
  std::vector<std::shared_ptr<CameraWorker>> leaving;
  for (const auto& camera : old_.cameras) {
    if (std::ranges::find(next_.cameras, camera) == next_.cameras.end()) leaving.push_back(camera);
  }
  for (const auto& camera : leaving) camera->request_stop();
  if (draft_.plan.views) {
    for (const auto& view : old_.views) view->stop();
    for (const auto& view : old_.views) {
      keep_output(view->output(), view->name(), !stay.contains(view->name()));
    }
    next_.views.clear();
  }
  for (const auto& camera : leaving) camera->stop();
  for (const auto& camera : leaving) {
    keep_output(camera->output(), camera->name(), !stay.contains(camera->name()));
  }
  if (draft_.plan.search && old_.search) old_.search->stop();
  if (draft_.plan.points && old_.points) old_.points->stop();
}

void SystemExchange::exchange_stages() {
  for (SystemDraft::Stages& stages : draft_.stages) {
    next_.cameras[stages.camera.index()]->exchange(std::move(stages.observe),
                                                   std::move(stages.draw));
  }
}

void SystemExchange::rename_poses() {
  FeedNames names = feed_names(next_);
  context_.recordings->rename(names);
  context_.poses->rename(std::move(names));
}

Result<std::shared_ptr<RtspStream>> SystemExchange::add_stream(const std::string& name,
                                                               const EncoderOptions& options) {
  return next_.rtsp->server().add_stream(name, {options.width, options.height, options.rate_hz});
}

Result<std::shared_ptr<StreamOutput>> SystemExchange::output_of(const std::string& name,
                                                                const EncoderOptions& options) {
  const auto found = outputs_.find(name);
  if (found != outputs_.end() && same_images(found->second->options(), options)) {
    auto output = found->second;
    if (!server_stays()) {
      SL_ASSIGN(auto stream, add_stream(name, options));
      output->move_to(std::move(stream));
    }
    output->adopt(next_.rig->names(), draft_.plan.encoder ? std::optional(options) : std::nullopt);
    return output;
  }
  if (found != outputs_.end()) {
    found->second->close();
    if (server_stays()) next_.rtsp->server().remove_stream(name);
  }
  SL_ASSIGN(auto stream, add_stream(name, options));
  return StreamOutput::create(name, options, next_.rig->names(), std::move(stream),
                              context_.whep->stream(name), context_.pictures->slot(name),
                              context_.recordings->viewing(), context_.registry);
}

// Of workers that go on, to a server that is another now.
Status SystemExchange::move_streams() {
  if (server_stays() || !next_.rtsp) return {};
  const auto move = [this](const auto& worker) -> Status {
    if (!worker || !worker->output()) return {};
    SL_ASSIGN(auto stream, add_stream(worker->name(), worker->output()->options()));
    worker->output()->move_to(std::move(stream));
    return {};
  };
  for (const auto& worker : next_.cameras) SL_RETURN_IF_ERROR(move(worker));
  for (const auto& worker : next_.views) SL_RETURN_IF_ERROR(move(worker));
  return {};
}

Status SystemExchange::start_cameras() {
  for (CameraParts& parts : draft_.cameras) {
    const CameraConfig& config = next_.installation.cameras[parts.id.index()];
    if (parts.draw.renderer) {
      SL_ASSIGN(parts.output, output_of(config.name, encoder_options(next_.installation, config)));
    }
    const size_t index = parts.id.index();
    next_.cameras[index] = CameraWorker::start(std::move(parts), context_.registry, context_.beats);
  }
  return {};
}

// Heads may follow what the pictures of others and their own show to move.
void SystemExchange::start_following() {
  auto moving = std::make_shared<MovingScene>();
  moving->board = next_.board;
  moving->boxes = moving_boxes(*next_.rig);
  const auto sharing = std::make_shared<FollowSharing>();
  for (size_t i = 0; i < next_.cameras.size(); ++i) {
    if (AngleWorker* const angles = next_.cameras[i]->angles()) angles->see(moving);
    const auto& head = next_.cameras[i]->head();
    if (!head || !head->follows()) continue;
    auto scene = follow_scene(next_.installation.cameras[i].follow, *next_.rig, next_.board);
    scene->sharing = sharing;
    scene->head = static_cast<int>(i);
    head->follow(std::move(scene));
  }
}

Status SystemExchange::start_views() {
  for (VirtualCameraParts& parts : draft_.views) {
    EncoderOptions options = next_.installation.encoder;
    options.width = parts.view->width();
    options.height = parts.view->height();
    options.rate_hz = parts.rate_hz;
    SL_ASSIGN(parts.output, output_of(parts.name, options));
    parts.present = [cameras = next_.cameras] {
      std::vector<bool> present;
      for (const auto& camera : cameras) present.push_back(camera->present());
      return present;
    };
    next_.views.push_back(
        VirtualCameraWorker::start(std::move(parts), context_.registry, context_.beats));
  }
  return {};
}

void SystemExchange::start_search() {
  if (!draft_.plan.search) return;
  next_.search.reset();
  if (draft_.search) {
    next_.search = SearchWorker::start(
        std::move(draft_.search), next_.cameras.size(), next_.board,
        to_fusion(context_, next_, nullptr),
        [fusion = next_.fusion, taps = context_.taps](ObjectId object, bool doubted) {
          fusion->set_doubted(object, doubted);
          if (const auto cell = taps->cell.read()) cell->set_doubted(object, doubted);
        },
        context_.registry, context_.beats);
  }
  context_.taps->search.publish(next_.search);
}

void SystemExchange::keep_last_poses() {
  if (old_.last_poses) (void)old_.last_poses->stop_unless_waiting(std::chrono::seconds(1));
  next_.last_poses.reset();
  std::vector<NamedObject> objects;
  for (const RigObject& object : next_.rig->objects) {
    const ObjectConfig& config = next_.installation.objects.at(object.named.id.index());
    if (config.start_last && !has_markers(object.description)) objects.push_back(object.named);
  }
  const auto file = last_poses_file(next_.installation);
  if (objects.empty() || file.empty()) return;
  next_.last_poses = LastPoseKeeper::start(file, std::move(objects), next_.board, context_.beats);
}

void SystemExchange::watch_calibration() {
  const Installation& now = next_.installation;
  if (!draft_.plan.watch && old_.fusion) return;
  if (old_.calibration) (void)old_.calibration->stop_unless_waiting(std::chrono::seconds(1));
  next_.calibration.reset();
  next_.fusion->set_cameras(watched_places(now));
  std::set<std::string> names;
  for (const CameraConfig& camera : now.cameras) names.insert(camera.name);
  next_.rooms->keep_only(names);
  if (!now.watch.enabled) return;
  next_.calibration = CalibrationKeeper::start(
      {.proposal = proposal_file(now.calibration, state_folder()),
       .rooms_file = now.watch.background ? scene_file(now) : std::filesystem::path(),
       .rooms = next_.rooms,
       .request_reload = context_.request_reload},
      now, next_.fusion, context_.registry, context_.beats);
}

void SystemExchange::start_actions() {
  if (draft_.plan.points) next_.points.reset();
  if (!draft_.plan.actions) return;
  if (old_.actions) old_.actions->stop();
  next_.actions = ActionWorker::start(next_.installation.action, context_.registry, context_.beats);
}

void SystemExchange::start_mqtt() {
  if (!draft_.plan.mqtt) return;
  if (old_.mqtt) (void)old_.mqtt->stop_unless_waiting(std::chrono::seconds(1));
  next_.mqtt =
      MqttWorker::start(next_.installation.mqtt, context_.poses, context_.registry, context_.beats);
}

void SystemExchange::start_cell() {
  if (!draft_.plan.cell) return;
  if (old_.cell) (void)old_.cell->stop_unless_waiting(std::chrono::seconds(1));
  const Installation& now = next_.installation;
  std::vector<CellHostState::Camera> cameras;
  for (const CameraConfig& camera : now.cameras) {
    cameras.push_back({camera.name, camera_hash(camera.calibration)});
  }
  next_.cell = CellWorker::start({.options = now.cell,
                                  .cameras = std::move(cameras),
                                  .names = feed_names(next_),
                                  .noise = now.estimator.noise,
                                  .board = next_.board,
                                  .own_board = next_.own_board,
                                  .fusion = next_.fusion,
                                  .on_estimate = feeds(context_, *next_.rig),
                                  .on_order = context_.on_order},
                                 context_.registry, context_.beats);
  context_.taps->cell.publish(next_.cell);
}

void SystemExchange::retire_old() {
  if (old_.rtsp && old_.rtsp != next_.rtsp) old_.rtsp->stop();
  if (old_.http && old_.http != next_.http) old_.http->stop();
  Registry& registry = context_.registry;
  const std::set<std::string> streams = stream_names(next_.installation);
  context_.pictures->keep_only({streams.begin(), streams.end()});
  context_.whep->keep_only({streams.begin(), streams.end()});
  remove_metrics(registry, old_.installation, next_.installation);
  if (old_.recorder && old_.recorder != next_.recorder) (void)old_.recorder->stop();
  if (!next_.recorder) {
    for (const char* state : {"recording", "stopped"}) registry.remove("state", state);
  }
}

std::shared_ptr<PointsWorker> SystemExchange::start_points() {
  if (!draft_.plan.points) return next_.points;
  const Installation& now = next_.installation;
  const auto observing = std::ranges::count_if(
      now.cameras, [](const CameraConfig& camera) { return observes(camera.role); });
  if (!now.points.enabled || observing < 2 || next_.rig->objects.empty()) return nullptr;
  std::shared_ptr<PointsWorker> points = PointsWorker::start(
      now.points, std::make_unique<ObjectPoints>(now, *next_.rig), now.cameras.size(),
      next_.rig->names(), next_.board, context_.registry, context_.beats);
  context_.taps->points.publish(points);
  return points;
}

}  // namespace sightline
