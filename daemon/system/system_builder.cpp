// SPDX-License-Identifier: Apache-2.0
#include "system/system_builder.hpp"

#include <algorithm>

#include "axes/axes_worker.hpp"
#include "sightline/base/files.hpp"
#include "sightline/pipeline/calibration_proposal.hpp"
#include "sightline/pipeline/parallel.hpp"
#include "sightline/pipeline/rig_parts.hpp"
#include "workers/object_events.hpp"
#include "workers/stage_latency.hpp"

namespace sightline {
namespace {

constexpr double kDefaultRate = 30;

Status check_not_stopped(const std::stop_token& stop) {
  if (!stop.stop_requested()) return {};
  return make_error(ErrorCode::kUnavailable, "", "the daemon is being stopped");
}

bool streams_camera(const Installation& installation, const CameraConfig& camera) {
  return installation.rtsp.enabled && streams(camera.role);
}

// An encoder that no camera could use is found out before the one that is in use goes.
Status try_encoder(const Installation& next) {
  for (const CameraConfig& camera : next.cameras) {
    if (!streams_camera(next, camera)) continue;
    const auto made = VideoEncoder::create(encoder_options(next, camera), camera.name, [](auto) {});
    return made ? Status() : Status(made.error());
  }
  return {};
}

bool begins_source(const Installation& installation) {
  return installation.record.enabled &&
         RecordConfig::names(installation.record.kinds, RecordingKind::kSource);
}

void hint_last_poses(const Installation& installation, ObjectSearch& search) {
  const auto starts_there = [](const ObjectConfig& object) { return object.start_last; };
  if (std::ranges::none_of(installation.objects, starts_there)) return;
  for (const PoseLogRow& row : read_last_poses(last_poses_file(installation))) {
    for (size_t i = 0; i < installation.objects.size(); ++i) {
      const ObjectConfig& object = installation.objects[i];
      if (!object.start_last || object.description.name != row.object) continue;
      search.hint(ObjectId(static_cast<uint32_t>(i)), *row.world_from_object);
    }
  }
}

// Whether this host's estimates are shown only where no other host's are.
bool estimates_apart(const CellOptions& cell) {
  return cell.enabled() && (fuses(cell.role) ? !cell.neighbors.empty() : cell.local);
}

}  // namespace

FusionWorker::OnEstimate feeds(const SystemContext& context, const Rig& rig) {
  return [taps = context.taps, poses = context.poses, recordings = context.recordings,
          events = std::make_shared<ObjectEvents>(rig.names())](const PoseEstimate& estimate,
                                                                FusionWorker::Cause cause) {
    poses->push(estimate);
    events->take(estimate);
    recordings->push(estimate, cause == FusionWorker::Cause::kFrame);
    if (cause != FusionWorker::Cause::kFrame) return;
    if (const auto recorder = taps->recorder.read()) recorder->push(estimate);
  };
}

FusionWorker::OnEstimate on_estimate(const SystemContext& context, const Installation& installation,
                                     const Rig& rig) {
  const auto to_cell = [taps = context.taps](const PoseEstimate& estimate,
                                             FusionWorker::Cause cause) {
    if (const auto cell = taps->cell.read()) cell->push(estimate, cause);
  };
  if (estimates_apart(installation.cell)) return to_cell;
  if (!fuses(installation.cell.role)) return {};
  return [to_cell, here = feeds(context, rig)](const PoseEstimate& estimate,
                                               FusionWorker::Cause cause) {
    here(estimate, cause);
    to_cell(estimate, cause);
  };
}

std::function<void(Observation)> to_fusion(const SystemContext& context, const System& system,
                                           LatencyHistogram* latency) {
  const auto to_cell = [taps = context.taps](const Observation& observation) {
    if (const auto cell = taps->cell.read()) cell->push(observation);
  };
  if (!fuses(system.installation.cell.role)) return to_cell;
  const bool travels = !system.installation.cell.neighbors.empty();
  return [fusion = system.fusion, latency, travels, to_cell](Observation observation) {
    if (travels) to_cell(observation);
    fusion->push(std::move(observation), latency);
  };
}

EncoderOptions encoder_options(const Installation& installation, const CameraConfig& camera) {
  EncoderOptions options = installation.encoder;
  options.width = camera.calibration.model.width();
  options.height = camera.calibration.model.height();
  options.rate_hz = camera.rate_hz > 0 ? camera.rate_hz : kDefaultRate;
  return options;
}

Result<SystemDraft> SystemBuilder::prepare(Installation next, std::stop_token stop) {
  SystemDraft draft;
  draft.plan =
      plan_reload(old_.installation, next, compare(old_.installation, next), old_.fusion_cameras);
  System& system = draft.system = old_;
  system.installation = std::move(next);
  system.zones = context_.recordings->zones();
  const Installation& now = system.installation;
  SL_RETURN_IF_ERROR(check_not_stopped(stop));
  if (draft.plan.rig || !old_.rig) {
    RigOptions options;
    options.stop = stop;
    options.before = {&old_.installation, old_.rig.get()};
    SL_ASSIGN(Rig rig, load_rig(now, options));
    system.rig = std::make_shared<const Rig>(std::move(rig));
  }
  SL_RETURN_IF_ERROR(check_not_stopped(stop));
  if (draft.plan.fusion || !old_.fusion) {
    system.board = std::make_shared<TrackBoard>(system.rig->objects.size());
    // What others estimate is shown beside what this host does.
    const bool own = fuses(now.cell.role), apart = estimates_apart(now.cell);
    system.own_board =
        apart ? std::make_shared<TrackBoard>(system.rig->objects.size()) : system.board;
    SL_ASSIGN(system.fusion,
              FusionWorker::start(now.estimator, system.rig->names(), system.rig->shape_symmetry(),
                                  system.rig->alike(), own || apart ? system.own_board : nullptr,
                                  own ? make_calibration_watch(now, *system.rig) : nullptr,
                                  context_.registry, context_.beats,
                                  on_estimate(context_, now, *system.rig)));
    system.fusion_cameras.clear();
  }
  if (!system.rooms) {
    system.rooms = std::make_shared<SceneReferences>();
    // Also where none is watched: a reload may change that, and would write the file anew.
    read_scene(scene_file(now), *system.rooms);
  }
  system.fusion_cameras.resize(std::max(system.fusion_cameras.size(), now.cameras.size()));
  for (size_t i = 0; i < now.cameras.size(); ++i) system.fusion_cameras[i] = now.cameras[i].name;
  SL_RETURN_IF_ERROR(prepare_cameras(draft, stop));
  if (draft.plan.views) {
    SL_ASSIGN(draft.views, view_parts(system));
  }
  if (draft.plan.search) {
    SL_ASSIGN(draft.search, ObjectSearch::create(now, *system.rig));
    if (draft.search) {
      hint_last_poses(now, *draft.search);
      draft.search->offer_to(system.found_views);
    }
  }
  if (draft.plan.recorder && records(now)) {
    SL_ASSIGN(draft.recorder, recorder_options(now));
  }
  if (draft.plan.encoder) SL_RETURN_IF_ERROR(try_encoder(now));
  SL_RETURN_IF_ERROR(prepare_servers(draft));
  SL_RETURN_IF_ERROR(check_not_stopped(stop));
  return draft;
}

// No camera's parts need another's.
Status SystemBuilder::prepare_cameras(SystemDraft& draft, const std::stop_token& stop) const {
  const size_t count = draft.plan.cameras.size();
  // Its objects are those of the observers.
  if (draft.plan.observers || !draft.system.found_views) {
    draft.system.found_views = std::make_shared<FoundViews>();
  }
  draft.system.cameras.assign(count, nullptr);
  std::vector<std::optional<CameraParts>> parts(count);
  std::vector<SystemDraft::Stages> stages(count);
  const auto make = [&](size_t i) -> Status {
    SL_RETURN_IF_ERROR(check_not_stopped(stop));
    const CameraId id(static_cast<uint32_t>(i));
    if (draft.plan.cameras[i] == ReloadPlan::Camera::kRestart) {
      SL_ASSIGN(parts[i], camera_parts(draft, id));
      return {};
    }
    SL_ASSIGN(stages[i], camera_stages(draft, id));
    return {};
  };
  SL_RETURN_IF_ERROR(for_each_index(run_in_parallel, count, make));
  for (size_t i = 0; i < count; ++i) {
    if (parts[i]) {
      draft.cameras.push_back(*std::move(parts[i]));
      continue;
    }
    draft.system.cameras[i] = old_.cameras[i];
    if (stages[i].observe || stages[i].draw) draft.stages.push_back(std::move(stages[i]));
  }
  return {};
}

Result<CameraParts> SystemBuilder::camera_parts(const SystemDraft& draft, CameraId id) const {
  const Installation& now = draft.system.installation;
  const CameraConfig& config = now.cameras[id.index()];
  CameraParts parts;
  parts.id = id;
  parts.name = config.name;
  parts.width = config.calibration.model.width();
  parts.height = config.calibration.model.height();
  parts.rate_hz = config.rate_hz;
  // An Aravis source has a deadline of its own, or none where triggers may pause.
  parts.reopen_when_stalled =
      config.source != SourceKind::kReplay && config.source != SourceKind::kAravis;
  if (observes(config.role)) {
    SL_ASSIGN(parts.observe, observe_stage(draft.system, id));
  }
  if (streams_camera(now, config)) {
    SL_ASSIGN(parts.draw, draw_stage(draft.system, id));
  }
  add_source(parts, config, records(now));
  if (config.axes_by_picture) {
    parts.angles = AngleWorker::create(config.calibration, context_.registry);
  }
  parts.on_captured = [taps = context_.taps](const FramePtr& frame) { taps->record(frame); };
  parts.on_frame = [taps = context_.taps, observed = observes(config.role)](const FramePtr& frame) {
    taps->push(frame, observed);
  };
  return parts;
}

// What reads the angles of a camera that turns lives as long as its worker.
void SystemBuilder::add_source(CameraParts& parts, const CameraConfig& config, bool payload) const {
  if (!config.calibration.axes || config.axes.protocol == AxisProtocol::kNone) {
    parts.open_source = context_.sources.opener(config, parts.id, payload);
    return;
  }
  parts.head = AxesWorker::start(config, context_.registry, context_.beats);
  parts.open_source = context_.sources.opener(config, parts.id, payload, parts.head->history());
}

Result<SystemDraft::Stages> SystemBuilder::camera_stages(const SystemDraft& draft,
                                                         CameraId id) const {
  const CameraConfig& config = draft.system.installation.cameras[id.index()];
  SystemDraft::Stages stages{id, nullptr, nullptr};
  if (draft.plan.observers && observes(config.role)) {
    SL_ASSIGN(ObserveStage stage, observe_stage(draft.system, id));
    stages.observe = std::make_unique<ObserveStage>(std::move(stage));
  }
  const bool restyled = draft.plan.cameras[id.index()] == ReloadPlan::Camera::kRestyle;
  if ((draft.plan.renderers || restyled) && streams_camera(draft.system.installation, config)) {
    SL_ASSIGN(DrawStage stage, draw_stage(draft.system, id));
    if (draft.plan.encoder) stage.encoder = encoder_options(draft.system.installation, config);
    stages.draw = std::make_unique<DrawStage>(std::move(stage));
  }
  return stages;
}

Result<ObserveStage> SystemBuilder::observe_stage(const System& next, CameraId id) const {
  ObserveStage stage;
  SL_ASSIGN(stage.observer, CameraObserver::create(next.installation, *next.rig, id));
  stage.observer->take_from(next.found_views);
  if (streams_camera(next.installation, next.installation.cameras[id.index()])) {
    SL_ASSIGN(stage.learner, make_learner(next.installation, *next.rig, id));
  }
  stage.board = next.board;
  const std::string& name = next.installation.cameras[id.index()].name;
  stage.on_observation =
      to_fusion(context_, next, &stage_latency(context_.registry, name, "fused"));
  stage.room = RoomWatch::create(next.installation, *next.rig, id, next.rooms);
  stage.on_scene = [fusion = next.fusion](SceneLook look) { fusion->push(std::move(look)); };
  return stage;
}

Result<DrawStage> SystemBuilder::draw_stage(const System& next, CameraId id) const {
  DrawStage stage;
  SL_ASSIGN(stage.renderer, make_renderer(next.installation, *next.rig, id));
  stage.board = next.board;
  stage.names = next.rig->names();
  stage.calibration_state = [fusion = next.fusion, id] {
    const auto watches = fusion->calibration();
    return watches && id.index() < watches->size() ? (*watches)[id.index()].state
                                                   : CalibrationState::kUnknown;
  };
  const CameraModel& lens = next.installation.cameras[id.index()].calibration.model;
  stage.slate =
      NoSignalSlate::create(lens.width(), lens.height(), next.installation.render.font_file);
  const PointsConfig& points = next.installation.points;
  if (points.enabled && points.overlay) {
    stage.points = [taps = context_.taps](Time time) { return taps->points_at(time); };
    const auto& geometry = next.rig->cameras[id.index()];
    stage.calibration = {geometry, &geometry->camera()};
  }
  return stage;
}

Result<std::vector<VirtualCameraParts>> SystemBuilder::view_parts(const System& next) const {
  std::vector<VirtualCameraParts> all;
  const Installation& now = next.installation;
  if (!now.rtsp.enabled) return all;
  for (size_t i = 0; i < now.virtual_cameras.size(); ++i) {
    const VirtualCameraConfig& config = now.virtual_cameras[i];
    VirtualCameraParts parts;
    parts.id = CameraId(static_cast<uint32_t>(now.cameras.size() + i));
    parts.name = config.name;
    parts.rate_hz = config.rate_hz;
    SL_ASSIGN(parts.view, make_view(now, *next.rig, config));
    parts.board = next.board;
    parts.points = [taps = context_.taps](Time time) { return taps->points_at(time); };
    all.push_back(std::move(parts));
  }
  return all;
}

Result<RecorderOptions> SystemBuilder::recorder_options(const Installation& next) const {
  RecorderOptions options;
  options.directory = next.record.directory;
  options.folder = context_.record_to;
  // What somebody ordered outlasts a reload.
  const bool ordered =
      old_.recorder && old_.recorder->wanted_for_good() && !begins_source(old_.installation);
  options.wanted = begins_source(next) || ordered;
  RecordingWriterOptions& writer = options.writer;
  writer.name = next.name;
  writer.raw_storage = next.record.raw_storage;
  for (const CameraConfig& camera : next.cameras) {
    SL_ASSIGN(const PixelFormat format, context_.sources.payload_format(camera));
    writer.cameras.push_back(
        {camera.name, format, camera.calibration.model.width(), camera.calibration.model.height()});
  }
  SL_ASSIGN(writer.calibration_toml, read_file(next.calibration));
  for (const ObjectConfig& object : next.objects) {
    writer.objects.push_back(object.description.file);
    options.objects.push_back(object.description.name);
  }
  if (!next.scene.meshes.empty()) writer.scene = next.scene.meshes.front();
  return options;
}

// A port that the running system holds cannot be had beside it; it is handed over later.
Status SystemBuilder::prepare_servers(SystemDraft& draft) const {
  System& next = draft.system;
  const auto& rtsp = next.installation.rtsp;
  const auto& http = next.installation.http;
  if (draft.plan.rtsp || !old_.rtsp) {
    next.rtsp.reset();
    if (rtsp.enabled && (!old_.rtsp || old_.rtsp->options().port != rtsp.server.port)) {
      SL_ASSIGN(next.rtsp, RtspService::start(rtsp.server, context_.beats));
    }
  }
  if (draft.plan.http || !old_.http) {
    next.http.reset();
    if (http.enabled && (!old_.http || old_.http->options().port != http.server.port)) {
      SL_ASSIGN(next.http, HttpService::start(http.server, context_.http));
    }
  }
  return {};
}

}  // namespace sightline
