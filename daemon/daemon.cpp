// SPDX-License-Identifier: Apache-2.0
#include "daemon.hpp"

#include <fmt/ranges.h>

#include <algorithm>
#include <ctime>

#include "object_views.hpp"
#include "sightline/base/files.hpp"
#include "sightline/base/log.hpp"
#include "sightline/base/thread.hpp"
#include "state_json.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr double kDefaultRate = 30;

EncoderOptions encoder_options(const Installation& installation, const CameraConfig& camera) {
  EncoderOptions options = installation.encoder;
  options.width = camera.calibration.model.width();
  options.height = camera.calibration.model.height();
  options.rate_hz = camera.rate_hz > 0 ? camera.rate_hz : kDefaultRate;
  return options;
}

bool cameras_differ(const InstallationChanges& changes) {
  return !changes.cameras_added.empty() || !changes.cameras_removed.empty() ||
         !changes.cameras_changed.empty();
}

// A folder that is not there yet, named by the time.
std::filesystem::path new_recording_folder(const std::filesystem::path& directory) {
  const auto now = static_cast<time_t>(utc_now_ns() / 1'000'000'000);
  std::tm parts{};
  gmtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y%m%dT%H%M%SZ", &parts);
  std::filesystem::path folder = directory / text;
  for (int i = 2; std::filesystem::exists(folder); ++i) {
    folder = directory / fmt::format("{}-{}", text, i);
  }
  return folder;
}

}  // namespace

Daemon::Daemon(Installation installation, DaemonOptions options)
    : options_(std::move(options)), installation_(std::move(installation)) {}

Daemon::~Daemon() { (void)stop(); }

Result<std::unique_ptr<Daemon>> Daemon::start(Installation installation,
                                              const DaemonOptions& options) {
  std::unique_ptr<Daemon> daemon(new Daemon(std::move(installation), options));
  const Installation& now = daemon->installation_;
  log::set_level(now.daemon.log_level);
  SL_ASSIGN(Rig rig, load_rig(now));
  daemon->rig_ = std::make_shared<const Rig>(std::move(rig));
  SL_ASSIGN(auto parts, daemon->prepare_all(now, *daemon->rig_));
  SL_ASSIGN(auto views, daemon->prepare_views(now, *daemon->rig_));
  SL_ASSIGN(auto search, ObjectSearch::create(now, *daemon->rig_, cache_folder()));
  SL_RETURN_IF_ERROR(daemon->start_recorder(now));
  SL_RETURN_IF_ERROR(daemon->start_servers(now));
  SL_RETURN_IF_ERROR(
      daemon->start_pipeline(now, *daemon->rig_, std::move(parts), std::move(search)));
  SL_RETURN_IF_ERROR(daemon->start_views(now, *daemon->rig_, std::move(views)));
  daemon->start_points(now, *daemon->rig_);
  daemon->actions_ = ActionUnit::start(now.action, daemon->registry_, daemon->beats_);
  return daemon;
}

Result<CameraParts> Daemon::prepare(const Installation& installation, const Rig& rig,
                                    size_t camera) {
  const CameraConfig& config = installation.cameras[camera];
  const CameraId id(static_cast<uint32_t>(camera));
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
    SL_ASSIGN(parts.observer, CameraObserver::create(installation, rig, id));
  }
  if (options_.serve && installation.rtsp.enabled && streams(config.role)) {
    SL_ASSIGN(parts.renderer, make_renderer(installation, rig, id));
    if (parts.observer) {
      SL_ASSIGN(parts.learner, make_learner(installation, rig, id));
    }
    parts.card = NoSignalCard::create(parts.width, parts.height, installation.render.font_file);
  }
  const bool payload = installation.record.enabled || !options_.record_to.empty();
  parts.open_source = sources_.opener(config, id, payload);
  return parts;
}

Result<std::vector<CameraParts>> Daemon::prepare_all(const Installation& installation,
                                                     const Rig& rig) {
  std::vector<CameraParts> all;
  for (size_t i = 0; i < installation.cameras.size(); ++i) {
    SL_ASSIGN(CameraParts parts, prepare(installation, rig, i));
    all.push_back(std::move(parts));
  }
  return all;
}

Status Daemon::start_recorder(const Installation& installation) {
  const bool explicit_folder = !options_.record_to.empty();
  if (!explicit_folder && !installation.record.enabled) return {};
  RecordingWriterOptions options;
  options.name = installation.name;
  options.raw_storage = installation.record.raw_storage;
  for (const CameraConfig& camera : installation.cameras) {
    SL_ASSIGN(const PixelFormat format, sources_.payload_format(camera));
    options.cameras.push_back(
        {camera.name, format, camera.calibration.model.width(), camera.calibration.model.height()});
  }
  SL_ASSIGN(options.calibration_toml, read_file(installation.calibration));
  std::vector<std::string> objects;
  for (const ObjectConfig& object : installation.objects) {
    options.objects.push_back(object.description.file);
    objects.push_back(object.description.name);
  }
  if (!installation.scene.meshes.empty()) options.scene = installation.scene.meshes.front();
  const auto folder =
      explicit_folder ? options_.record_to : new_recording_folder(installation.record.directory);
  SL_ASSIGN(recorder_, RecorderUnit::start(folder, options, objects, registry_, beats_));
  return {};
}

Status Daemon::start_servers(const Installation& installation) {
  if (!options_.serve) return {};
  if (installation.rtsp.enabled && !rtsp_) {
    SL_ASSIGN(auto made, RtspServer::create(installation.rtsp.server));
    serve_rtsp(std::move(made));
  }
  if (installation.http.enabled && !http_) {
    SL_ASSIGN(http_, make_http(installation));
  }
  return {};
}

void Daemon::serve_rtsp(std::unique_ptr<RtspServer> server) {
  rtsp_ = std::move(server);
  rtsp_thread_ =
      start_thread("rtsp", [raw = rtsp_.get()](std::stop_token stop) { raw->run(stop); });
}

void Daemon::stop_rtsp() {
  rtsp_thread_.request_stop();
  if (rtsp_thread_.joinable()) rtsp_thread_.join();
  rtsp_.reset();
}

Result<std::unique_ptr<HttpServer>> Daemon::make_http(const Installation& installation) {
  HttpContent content;
  content.registry = &registry_;
  content.health = [this] { return health(); };
  content.state_json = [this] { return state_json(); };
  return HttpServer::create(installation.http.server, std::move(content));
}

namespace {

std::function<ScenePointsPtr(Time)> points_from(std::shared_ptr<UnitSlot<PointsUnit>> slot) {
  return [slot = std::move(slot)](Time time) {
    const auto unit = slot->get();
    return unit ? unit->points_at(time) : nullptr;
  };
}

}  // namespace

Status Daemon::start_camera(const Installation& installation, const Rig& rig, CameraParts parts) {
  const CameraConfig& config = installation.cameras[parts.id.index()];
  if (parts.renderer) {
    SL_ASSIGN(auto stream,
              rtsp_->add_stream(config.name, {parts.width, parts.height,
                                              encoder_options(installation, config).rate_hz}));
    parts.output = StreamOutput::create(config.name, encoder_options(installation, config),
                                        rig.names(), std::move(stream), registry_);
  }
  parts.board = board_;
  parts.on_observation = [fusion = fusion_](Observation observation) {
    fusion->push(std::move(observation));
  };
  const auto points = observes(config.role) ? points_ : nullptr;
  parts.on_frame = [recorder = recorder_, search = search_, points](const FramePtr& frame) {
    if (recorder) recorder->push(frame);
    if (const auto unit = search->get()) unit->push(frame);
    if (const auto unit = points ? points->get() : nullptr) unit->push(frame);
  };
  if (installation.points.enabled && installation.points.overlay) {
    parts.calibration = std::make_shared<const CalibratedCamera>(config.calibration);
    parts.points = points_from(points_);
  }
  auto unit = CameraUnit::start(std::move(parts), registry_, beats_);
  std::lock_guard lock(mutex_);
  cameras_[config.name] = std::move(unit);
  return {};
}

Result<std::vector<ViewParts>> Daemon::prepare_views(const Installation& installation,
                                                     const Rig& rig) const {
  std::vector<ViewParts> all;
  if (!options_.serve || !installation.rtsp.enabled) return all;
  for (size_t i = 0; i < installation.views.size(); ++i) {
    const ViewConfig& config = installation.views[i];
    ViewParts parts;
    parts.id = CameraId(static_cast<uint32_t>(installation.cameras.size() + i));
    parts.name = config.name;
    parts.rate_hz = config.rate_hz;
    SL_ASSIGN(parts.view, make_view(installation, rig, config));
    all.push_back(std::move(parts));
  }
  return all;
}

Status Daemon::start_views(const Installation& installation, const Rig& rig,
                           std::vector<ViewParts> views) {
  for (ViewParts& parts : views) {
    const int width = parts.view->width(), height = parts.view->height();
    SL_ASSIGN(auto stream, rtsp_->add_stream(parts.name, {width, height, parts.rate_hz}));
    EncoderOptions encoder = installation.encoder;
    encoder.width = width;
    encoder.height = height;
    encoder.rate_hz = parts.rate_hz;
    parts.output =
        StreamOutput::create(parts.name, encoder, rig.names(), std::move(stream), registry_);
    parts.board = board_;
    std::vector<std::string> names;
    for (const CameraConfig& camera : installation.cameras) names.push_back(camera.name);
    parts.present = [this, names] { return present(names); };
    parts.points = points_from(points_);
    auto unit = ViewUnit::start(std::move(parts), registry_, beats_);
    std::lock_guard lock(mutex_);
    views_.push_back(std::move(unit));
  }
  return {};
}

void Daemon::stop_views() {
  std::vector<std::unique_ptr<ViewUnit>> stopping;
  {
    std::lock_guard lock(mutex_);
    stopping.swap(views_);
  }
  // Without the lock: their threads take it to see which cameras are there.
  for (const auto& unit : stopping) {
    unit->stop();
    unit->output()->close();
    rtsp_->remove_stream(unit->name());
  }
}

std::vector<bool> Daemon::present(const std::vector<std::string>& names) const {
  std::lock_guard lock(mutex_);
  std::vector<bool> out;
  for (const std::string& name : names) {
    const auto unit = cameras_.find(name);
    out.push_back(unit != cameras_.end() && unit->second->status().present);
  }
  return out;
}

Status Daemon::start_pipeline(const Installation& installation, const Rig& rig,
                              std::vector<CameraParts> parts,
                              std::unique_ptr<ObjectSearch> search) {
  {
    std::lock_guard lock(mutex_);
    board_ = std::make_shared<TrackBoard>(rig.objects.size());
  }
  FusionUnit::OnEstimate on_estimate;
  if (recorder_) {
    on_estimate = [recorder = recorder_](const PoseEstimate& estimate) {
      recorder->push(estimate);
    };
  }
  SL_ASSIGN(fusion_, FusionUnit::start(installation.estimator, rig.names(), rig.lookalikes(),
                                       board_, registry_, beats_, std::move(on_estimate)));
  start_search(installation, std::move(search));
  for (CameraParts& camera : parts) {
    SL_RETURN_IF_ERROR(start_camera(installation, rig, std::move(camera)));
  }
  return {};
}

void Daemon::start_search(const Installation& installation, std::unique_ptr<ObjectSearch> search) {
  search_->replace(nullptr);
  std::shared_ptr<SearchUnit> unit;
  if (search) {
    unit = SearchUnit::start(
        std::move(search), installation.cameras.size(), board_,
        [fusion = fusion_](Observation found) { fusion->push(std::move(found)); }, registry_,
        beats_);
  }
  search_->replace(std::move(unit));
}

// Last: it takes a moment to make, and a stream that is not there yet is refused to its viewers.
void Daemon::start_points(const Installation& installation, const Rig& rig) {
  points_->replace(nullptr);
  const auto observing =
      std::count_if(installation.cameras.begin(), installation.cameras.end(),
                    [](const CameraConfig& camera) { return observes(camera.role); });
  std::shared_ptr<PointsUnit> unit;
  if (options_.serve && installation.points.enabled && observing > 1 && !rig.objects.empty()) {
    unit = PointsUnit::start(installation.points, std::make_unique<ObjectPoints>(installation, rig),
                             installation.cameras.size(), rig.names(), board_, registry_, beats_);
  }
  points_->replace(std::move(unit));
}

void Daemon::stop_cameras() {
  for (auto& [name, unit] : cameras_) unit->request_stop();
  for (auto& [name, unit] : cameras_) {
    unit->stop();
    if (unit->output()) {
      unit->output()->close();
      rtsp_->remove_stream(name);
    }
  }
  std::lock_guard lock(mutex_);
  cameras_.clear();
}

Status Daemon::stop() {
  stop_views();
  actions_.reset();
  stop_cameras();
  search_->replace(nullptr);
  points_->replace(nullptr);
  if (fusion_) fusion_->stop();
  http_.reset();
  stop_rtsp();
  return recorder_ ? recorder_->stop() : Status();
}

Status Daemon::reload(Installation next) {
  const InstallationChanges changes = compare(installation_, next);
  if (changes.none()) {
    log::info("reload: nothing differs");
    return {};
  }
  const std::string summary = changes.summary();
  const bool everything =
      changes.camera_ids || changes.object_ids || changes.scene || changes.surfaces ||
      changes.observe || changes.estimator || changes.rtsp || changes.encoder || changes.http ||
      changes.record || !changes.objects_added.empty() || !changes.objects_removed.empty() ||
      !changes.objects_changed.empty() || (recorder_ && cameras_differ(changes));
  SL_RETURN_IF_ERROR(everything ? restart_all(std::move(next))
                                : restart_some(std::move(next), changes));
  if (changes.action) {
    actions_.reset();
    actions_ = ActionUnit::start(installation_.action, registry_, beats_);
  }
  log::set_level(installation_.daemon.log_level);
  log::info("reload: {}", summary);
  return {};
}

Status Daemon::restart_all(Installation next) {
  // All that can fail is made before the first unit stops, so that a file that cannot be run leaves
  // everything as it was.
  SL_ASSIGN(Rig rig, load_rig(next));
  auto loaded = std::make_shared<const Rig>(std::move(rig));
  SL_ASSIGN(auto parts, prepare_all(next, *loaded));
  SL_ASSIGN(auto views, prepare_views(next, *loaded));
  SL_ASSIGN(auto search, ObjectSearch::create(next, *loaded, cache_folder()));
  SL_ASSIGN(Servers servers, make_moved_servers(next));
  stop_views();
  stop_cameras();
  search_->replace(nullptr);
  points_->replace(nullptr);
  fusion_->stop();
  if (recorder_) (void)recorder_->stop();
  recorder_.reset();
  replace_servers(next, std::move(servers));
  {
    std::lock_guard lock(mutex_);
    installation_ = std::move(next);
    rig_ = loaded;
  }
  SL_RETURN_IF_ERROR(start_recorder(installation_));
  SL_RETURN_IF_ERROR(start_servers(installation_));
  SL_RETURN_IF_ERROR(start_pipeline(installation_, *rig_, std::move(parts), std::move(search)));
  SL_RETURN_IF_ERROR(start_views(installation_, *rig_, std::move(views)));
  start_points(installation_, *rig_);
  return {};
}

Result<Daemon::Servers> Daemon::make_moved_servers(const Installation& next) {
  const auto& rtsp = installation_.rtsp;
  const auto& http = installation_.http;
  Servers made;
  const bool rtsp_moves = !rtsp_ || next.rtsp.server.port != rtsp.server.port ||
                          next.rtsp.server.address != rtsp.server.address;
  if (next.rtsp.enabled && rtsp_moves) {
    SL_ASSIGN(made.rtsp, RtspServer::create(next.rtsp.server));
  }
  const bool http_moves = !http_ || next.http.server.port != http.server.port ||
                          next.http.server.address != http.server.address;
  if (next.http.enabled && http_moves) {
    SL_ASSIGN(made.http, make_http(next));
  }
  return made;
}

// A server whose address stays but whose other options differ is made anew after the old one has
// let go of the port.
void Daemon::replace_servers(const Installation& next, Servers servers) {
  const InstallationChanges changes = compare(installation_, next);
  if (changes.rtsp) {
    stop_rtsp();
    if (servers.rtsp) serve_rtsp(std::move(servers.rtsp));
  }
  if (changes.http) http_ = std::move(servers.http);
}

Status Daemon::restart_some(Installation next, const InstallationChanges& changes) {
  const auto index_of = [&next](const std::string& name) {
    size_t i = 0;
    while (next.cameras[i].name != name) ++i;
    return i;
  };
  std::vector<CameraParts> parts;
  for (const auto* names : {&changes.cameras_added, &changes.cameras_changed}) {
    for (const std::string& name : *names) {
      SL_ASSIGN(CameraParts made, prepare(next, *rig_, index_of(name)));
      parts.push_back(std::move(made));
    }
  }
  // What looks into all cameras at once is made anew with any of them.
  std::unique_ptr<ObjectSearch> search;
  if (cameras_differ(changes)) {
    SL_ASSIGN(search, ObjectSearch::create(next, *rig_, cache_folder()));
  }
  // Views show the cameras and what all draw, so they are made anew with either.
  const bool views_differ = changes.views || changes.render || cameras_differ(changes);
  std::vector<ViewParts> views;
  if (views_differ) {
    SL_ASSIGN(views, prepare_views(next, *rig_));
  }
  std::map<std::string, std::unique_ptr<CameraRenderer>> renderers;
  for (const CameraConfig& camera : next.cameras) {
    const auto& styled = changes.cameras_restyled;
    const bool restyled =
        changes.render || std::find(styled.begin(), styled.end(), camera.name) != styled.end();
    if (!restyled || !streams(camera.role)) continue;
    const CameraId id(static_cast<uint32_t>(index_of(camera.name)));
    SL_ASSIGN(renderers[camera.name], make_renderer(next, *rig_, id));
  }
  if (views_differ) stop_views();
  for (const auto* names : {&changes.cameras_removed, &changes.cameras_changed}) {
    for (const std::string& name : *names) {
      const auto unit = cameras_.find(name);
      if (unit == cameras_.end()) continue;
      unit->second->stop();
      if (unit->second->output()) rtsp_->remove_stream(name);
      std::lock_guard lock(mutex_);
      cameras_.erase(unit);
    }
  }
  for (auto& [name, renderer] : renderers) {
    const auto unit = cameras_.find(name);
    if (unit != cameras_.end()) unit->second->set_renderer(std::move(renderer));
  }
  {
    std::lock_guard lock(mutex_);
    installation_ = std::move(next);
  }
  if (cameras_differ(changes)) {
    start_search(installation_, std::move(search));
  }
  for (CameraParts& made : parts) {
    SL_RETURN_IF_ERROR(start_camera(installation_, *rig_, std::move(made)));
  }
  SL_RETURN_IF_ERROR(start_views(installation_, *rig_, std::move(views)));
  if (cameras_differ(changes)) start_points(installation_, *rig_);
  return {};
}

bool Daemon::ended() const {
  std::lock_guard lock(mutex_);
  if (cameras_.empty()) return false;
  for (const auto& [name, unit] : cameras_) {
    if (!unit->status().ended) return false;
  }
  return true;
}

std::string Daemon::record_problem() const { return recorder_ ? recorder_->problem() : ""; }

std::vector<std::string> Daemon::addresses() const {
  std::lock_guard lock(mutex_);
  std::vector<std::string> out;
  for (const auto& [name, unit] : cameras_) {
    if (unit->output()) out.push_back(unit->output()->url());
  }
  for (const auto& unit : views_) out.push_back(unit->output()->url());
  if (http_) {
    out.push_back(
        fmt::format("http://{}:{}/metrics", installation_.http.server.address, http_->port()));
  }
  return out;
}

std::string Daemon::status_line() const {
  std::lock_guard lock(mutex_);
  size_t present = 0;
  std::string absent;
  for (const auto& [name, unit] : cameras_) {
    if (unit->status().present) {
      ++present;
    } else {
      absent += (absent.empty() ? "" : ", ") + name;
    }
  }
  std::string line = fmt::format("{} of {} cameras", present, cameras_.size());
  if (!absent.empty()) line += " (without " + absent + ")";
  std::vector<PoseTrackPtr> tracks;
  if (board_) board_->read(tracks);
  for (size_t i = 0; i < tracks.size(); ++i) {
    const auto& track = tracks[i];
    const TrackState state =
        track && !track->empty() ? track->newest().state : TrackState::kSearching;
    line += fmt::format("; {}: {}", rig_->objects[i].named.name, to_string(state));
  }
  return line;
}

Health Daemon::health() const {
  const auto names = stalled();
  Health health;
  health.ok = names.empty();
  health.text =
      health.ok ? status_line() : "no progress in " + fmt::format("{}", fmt::join(names, ", "));
  return health;
}

std::string Daemon::state_json() const {
  std::lock_guard lock(mutex_);
  std::vector<CameraState> cameras;
  for (const auto& [name, unit] : cameras_) {
    CameraState state{name, unit->status(), "", "", 0};
    if (const auto& output = unit->output()) {
      state.url = output->url();
      state.encoder = output->encoder_name();
      state.viewers = output->viewers();
    }
    cameras.push_back(std::move(state));
  }
  std::vector<PoseTrackPtr> tracks;
  if (board_) board_->read(tracks);
  std::vector<std::string> camera_names;
  for (const CameraConfig& camera : installation_.cameras) camera_names.push_back(camera.name);
  const auto points = points_->get();
  return format_state_json(installation_.name, cameras, rig_->names(), tracks, camera_names,
                           points ? points->checks() : std::vector<PointCheck>());
}

}  // namespace sightline
