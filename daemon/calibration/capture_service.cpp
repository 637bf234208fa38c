// SPDX-License-Identifier: Apache-2.0
#include "calibration/capture_service.hpp"

#include <algorithm>

#include "calibration/capture_files.hpp"
#include "calibration/capture_targets.hpp"
#include "calibration/capture_words.hpp"
#include "sightline/base/files.hpp"
#include "sightline/base/log.hpp"
#include "sightline/base/waiting.hpp"
#include "sightline/pipeline/last_poses.hpp"
#include "web/utc_text.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

namespace fs = std::filesystem;

constexpr Duration kTurn = 150ms, kStallLimit = 5s;
constexpr size_t kMostSets = 200;  // nobody shows it more often, and a solution takes its time

fs::path captures_folder() {
  const fs::path state = state_folder();
  return state.empty() ? state : state / "captures";
}

/// "20261125T140500Z"
std::string folder_name(int64_t utc_ns) {
  std::string name = utc_text(utc_ns);
  std::erase_if(name, [](char c) { return c == '-' || c == ':'; });
  return name;
}

Result<fs::path> make_folder(int64_t utc_ns) {
  const fs::path all = captures_folder();
  if (all.empty()) {
    return make_error(ErrorCode::kUnavailable, "capture",
                      "there is no folder to keep it in: set STATE_DIRECTORY or XDG_STATE_HOME");
  }
  std::error_code error;
  fs::create_directories(all, error);
  const std::string name = folder_name(utc_ns);
  fs::path folder = all / name;
  for (int copy = 2; !error && !fs::create_directory(folder, error) && !error; ++copy) {
    folder = all / fmt::format("{}_{}", name, copy);  // one of the same second
  }
  if (!error) return folder;
  return make_error(ErrorCode::kIo, folder.string(), "cannot make it: {}", error.message());
}

/// The newest capture that has taken something.
Result<CalibrationViews> newest_views() {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator it(captures_folder(), error), end; !error && it != end;
       it.increment(error)) {
    std::error_code ignored;
    if (fs::exists(it->path() / "corners.csv", ignored)) files.push_back(it->path());
  }
  if (files.empty()) {
    return make_error(ErrorCode::kInvalidInput, "resume", "there is no earlier capture");
  }
  const fs::path file = *std::ranges::max_element(files) / "corners.csv";
  SL_ASSIGN(const std::string text, read_file(file));
  return parse_views(text, file.string());
}

std::vector<std::string> names_of(const std::vector<ViewedCamera>& cameras) {
  std::vector<std::string> names;
  for (const ViewedCamera& camera : cameras) names.push_back(camera.name);
  return names;
}

std::vector<std::string> remarks_of(const RigReport& report) {
  std::vector<std::string> lines;
  for (const CameraReport& camera : report.cameras) {
    for (const std::string& remark : camera.remarks) lines.push_back(camera.name + ": " + remark);
  }
  return lines;
}

Result<CaptureSessionOptions> session_options(const CaptureOrder& order,
                                              const Installation& installation,
                                              const std::vector<size_t>& cameras) {
  SL_ASSIGN(CalibrationTarget target, choose_target(order, installation));
  CaptureSessionOptions options{
      .target = std::move(target), .window = 0, .solve = {}, .guide = {}, .earlier = {}};
  options.live = true;
  options.solve.time_offsets = options.guide.moving = order.moving;
  options.solve.readouts = order.readouts;
  for (const size_t i : cameras) {
    const CameraModel& lens = installation.cameras[i].calibration.model;
    CameraPrior prior{lens.parameters().lens, {}};
    prior.readout_s = installation.cameras[i].calibration.readout_s;
    if (order.keep_lenses) prior.known = lens;
    options.solve.cameras.push_back(prior);
  }
  if (order.resume) {
    SL_ASSIGN(options.earlier, newest_views());
  }
  return options;
}

}  // namespace

struct CaptureService::Run {
  std::shared_ptr<CaptureSession> session;
  std::vector<std::string> names;
  CaptureShown about;  // what does not change
  Time start = MonotonicClock::now();
  std::string ended_by{};  // what ended it, unless it passed
};

CaptureService::CaptureService(HeartbeatBoard& beats, std::shared_ptr<FrameTaps> taps)
    : beats_(beats), taps_(std::move(taps)) {
  shown_.publish(std::make_shared<const CaptureShown>());
}

CaptureService::~CaptureService() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

bool CaptureService::busy() const {
  const CapturePhase phase = shown_.read()->phase;
  return phase == CapturePhase::kRunning || phase == CapturePhase::kSolving;
}

Result<fs::path> CaptureService::start(const CaptureOrder& order,
                                       const Installation& installation) {
  SL_ASSIGN(const std::vector<size_t> cameras, choose_cameras(order, installation));
  SL_ASSIGN(const CaptureSessionOptions options, session_options(order, installation, cameras));
  const auto run = std::make_shared<Run>();
  CaptureShown& about = run->about;
  about.since_utc_ns = utc_now_ns();
  SL_ASSIGN(about.folder, make_folder(about.since_utc_ns));
  about.target = options.target.describe();
  about.moving = order.moving;
  about.readouts = order.readouts;
  about.keep_lenses = order.keep_lenses;
  about.needs = options.guide;
  SL_ASSIGN(run->session, CaptureSession::start(installation, cameras, options));
  run->names = names_of(run->session->cameras());
  const std::lock_guard lock(mutex_);
  if (stopped_) {
    return make_error(ErrorCode::kUnavailable, "capture", "the daemon is being stopped");
  }
  if (thread_.joinable()) thread_.join();  // of the one before, which is over
  asked_to_end_ = false;
  show(CapturePhase::kRunning, *run, run->session->state());
  taps_->targets.publish(run->session->frames());
  log::info("capture: {} is looked for, {}", about.target, about.folder.string());
  thread_ = WatchedThread(
      beats_, "capture", kStallLimit,
      [this, run](std::stop_token stop, Heartbeat& beat) { this->run(stop, beat, *run); });
  return about.folder;
}

Status CaptureService::conclude() {
  if (shown_.read()->phase != CapturePhase::kRunning) {
    return make_error(ErrorCode::kNotFound, "capture", "there is none that could be stopped");
  }
  asked_to_end_ = true;
  return {};
}

bool CaptureService::stop(Duration patience) {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
  thread_.request_stop();
  return !thread_.joinable() || thread_.heartbeat().wait_for_end(patience);
}

void CaptureService::wait_a_turn(const std::stop_token& stop) {
  std::unique_lock lock(turn_mutex_);
  never_.wait_for(lock, stop, kTurn, [] { return false; });
}

void CaptureService::show(CapturePhase phase, const Run& run, const CaptureState& state) {
  auto shown = std::make_shared<CaptureShown>(run.about);
  shown->phase = phase;
  shown->words = phase == CapturePhase::kSolving ? "what was taken is being solved"
                                                 : next_words(state, run.names);
  if (phase == CapturePhase::kRunning && !state.passed) shown->hint = hint_words(state.step);
  shown->state = state;
  shown->cameras = run.session->cameras();
  for (size_t a = 0; a < run.names.size(); ++a) {
    shown->coverage.push_back(run.session->coverage(a));
    for (size_t b = a + 1; b < run.names.size(); ++b) {
      const size_t sets = run.session->links(a, b);
      if (sets > 0) shown->links.push_back({a, b, sets});
    }
  }
  shown_.publish(std::move(shown));
}

void CaptureService::run(const std::stop_token& stop, Heartbeat& heartbeat, Run& run) {
  Status done = watch(stop, heartbeat, run);
  if (taps_->targets.read() == run.session->frames()) taps_->targets.publish(nullptr);
  if (done) done = finish(stop, heartbeat, run);
  if (!done) {
    auto shown = std::make_shared<CaptureShown>(*shown_.read());
    shown->phase = CapturePhase::kFailed;
    shown->words = done.error().message();
    shown->hint.clear();
    log::warning("capture: {}", shown->words);
    shown_.publish(std::move(shown));
  }
  run.session->stop();
}

Status CaptureService::watch(const std::stop_token& stop, Heartbeat& heartbeat, Run& run) {
  size_t kept = SIZE_MAX;
  std::string words;
  while (!stop.stop_requested()) {
    heartbeat.beat();
    const CaptureState state = run.session->state();
    show(CapturePhase::kRunning, run, state);
    if (state.sets != kept || state.advice.words != words) {
      kept = state.sets;
      words = state.advice.words;
      const Waiting waiting("the disk");
      SL_RETURN_IF_ERROR(keep_capture(*run.session, run.names, run.about.folder, false));
    }
    if (state.error) return *state.error;
    SL_RETURN_IF_ERROR(check_present(state, run.names, MonotonicClock::now() - run.start,
                                     "\"cameras\" chooses those that take part"));
    if (taps_->targets.read() != run.session->frames()) run.ended_by = "other cameras by a reload";
    if (asked_to_end_) run.ended_by = "order";
    if (state.passed || state.sets >= kMostSets || !run.ended_by.empty()) return {};
    wait_a_turn(stop);
  }
  return make_error(ErrorCode::kUnavailable, "capture", "the daemon was stopped");
}

Status CaptureService::finish(const std::stop_token& stop, Heartbeat& heartbeat, Run& run) {
  run.session->conclude();
  CaptureState state = run.session->state();
  for (; !state.concluded; state = run.session->state()) {
    heartbeat.beat();
    if (stop.stop_requested()) {
      return make_error(ErrorCode::kUnavailable, "capture", "the daemon was stopped");
    }
    show(CapturePhase::kSolving, run, state);
    wait_a_turn(stop);
  }
  const Waiting waiting("the disk");
  SL_RETURN_IF_ERROR(keep_capture(*run.session, run.names, run.about.folder, true));
  const auto solved = run.session->solved();
  if (state.error) return *state.error;
  if (state.sets == 0 || state.refusal || !solved) {
    return make_error(
        ErrorCode::kInvalidInput, "", "stopped by {}, no calibration: {}", run.ended_by,
        state.sets == 0 ? "no view was taken" : state.refusal.value_or("nothing was solved"));
  }
  SL_RETURN_IF_ERROR(write_solved(run.about.folder, solved->views, solved->rig));
  run.about.grade = solved->rig.report.grade;
  run.about.remarks = remarks_of(solved->rig.report);
  show(CapturePhase::kDone, run, state);
  auto shown = std::make_shared<CaptureShown>(*shown_.read());
  shown->words =
      fmt::format("Done, {}: {}", to_string(*run.about.grade),
                  ("captures" / run.about.folder.filename() / "calibration.toml").string());
  log::info("capture: {}", shown->words);
  shown_.publish(std::move(shown));
  return {};
}

}  // namespace sightline
