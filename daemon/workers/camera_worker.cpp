// SPDX-License-Identifier: Apache-2.0
#include "workers/camera_worker.hpp"

#include <algorithm>

#include "sightline/base/log.hpp"
#include "sightline/base/priority.hpp"
#include "workers/stage_latency.hpp"
#include "workers/wait_to_reopen.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kTurn = 200ms;     // longest wait of a thread without a look at its stop token
constexpr Duration kStallLimit = 5s;  // a thread silent for longer is hung

// A device may take its time to let go of its images.
void close_source(std::unique_ptr<FrameSource>& source) {
  const Waiting wait("the camera");
  source.reset();
}

Labels camera_labels(const std::string& name) { return {{"camera", name}}; }
Labels stage_labels(const std::string& name, const char* stage) {
  return {{"camera", name}, {"stage", stage}};
}

// Why a source is not there, for metrics.
const char* cause_of(const Error& error, const char* otherwise) {
  switch (error.code) {
    case ErrorCode::kTimeout:
      return "silent";
    case ErrorCode::kInvalidInput:
      return "mismatch";
    case ErrorCode::kDamaged:
      return "damaged";
    default:
      return otherwise;
  }
}

constexpr const char* kDropped = "sightline_frames_dropped_total";
constexpr const char* kDroppedHelp = "Frames that a stage had no time for, by stage";

}  // namespace

std::unique_ptr<CameraWorker> CameraWorker::start(CameraParts parts, Registry& registry,
                                                  HeartbeatBoard& beats) {
  std::unique_ptr<CameraWorker> worker(new CameraWorker(std::move(parts), registry));
  CameraWorker* raw = worker.get();
  const std::string& name = raw->parts_.name;
  const auto launch = [&](const char* kind,
                          void (CameraWorker::*body)(std::stop_token, Heartbeat&)) {
    return WatchedThread(
        beats, std::string(kind) + ":" + name, kStallLimit,
        [raw, body](std::stop_token stop, Heartbeat& heartbeat) { (raw->*body)(stop, heartbeat); });
  };
  if (raw->parts_.observe.observer) raw->observe_thread_ = launch("obs", &CameraWorker::observe);
  if (raw->parts_.output) raw->draw_thread_ = launch("draw", &CameraWorker::draw);
  if (raw->parts_.angles) {
    raw->parts_.angles->start(beats, [raw](const FramePtr& frame) { raw->pass_on(frame); });
  }
  raw->capture_thread_ = launch("cap", &CameraWorker::capture);
  return worker;
}

CameraWorker::CameraWorker(CameraParts parts, Registry& registry)
    : parts_(std::move(parts)),
      observes_(parts_.observe.observer != nullptr),
      images_(parts_.width, parts_.height),
      signal_(parts_.width, parts_.height, MonotonicClock::now()),
      registry_(registry),
      frames_(registry.counter("sightline_frames_total", "Frames captured",
                               camera_labels(parts_.name))),
      lost_(registry.counter(kDropped, kDroppedHelp, stage_labels(parts_.name, "capture"))),
      damaged_(registry.counter("sightline_frames_damaged_total",
                                "Frames that arrived damaged; not shown, not measured",
                                camera_labels(parts_.name))),
      reopened_(registry.counter("sightline_source_opened_total", "Times the source was opened",
                                 camera_labels(parts_.name))),
      observe_dropped_(
          registry.counter(kDropped, kDroppedHelp, stage_labels(parts_.name, "observe"))),
      draw_dropped_(registry.counter(kDropped, kDroppedHelp, stage_labels(parts_.name, "draw"))),
      capture_age_(registry.gauge("sightline_capture_latency_seconds",
                                  "From middle of exposure to arrival, newest frame",
                                  camera_labels(parts_.name))),
      draw_seconds_(registry.gauge("sightline_draw_seconds",
                                   "Copying and drawing the newest shown frame",
                                   camera_labels(parts_.name))),
      present_gauge_(registry.gauge("sightline_camera_present",
                                    "1 while the source is open and frames come, else 0",
                                    camera_labels(parts_.name))),
      rate_(registry.gauge("sightline_frame_rate_hertz",
                           "Frames that come, averaged over about a second",
                           camera_labels(parts_.name))),
      capture_error_(registry.gauge("sightline_capture_error_seconds",
                                    "Bound on the error of the newest capture time; 0: not known",
                                    camera_labels(parts_.name))),
      occluded_share_(
          registry.gauge("sightline_occluded_share",
                         "Share of the objects' pixels that something was learned to hide",
                         camera_labels(parts_.name))) {
  signal_.set_rate(parts_.rate_hz);
  captured_ = &stage_latency(registry, parts_.name, "captured");
  if (parts_.angles) {
    angles_dropped_ = &registry.counter(kDropped, kDroppedHelp, stage_labels(parts_.name, "turn"));
  }
  if (observes_) observed_ = &stage_latency(registry, parts_.name, "observed");
  if (parts_.output) drawn_ = &stage_latency(registry, parts_.name, "drawn");
}

void CameraWorker::request_stop() {
  if (parts_.head) parts_.head->request_stop();
  if (parts_.angles) parts_.angles->request_stop();
  for (auto* thread : {&capture_thread_, &observe_thread_, &draw_thread_}) thread->request_stop();
}

void CameraWorker::stop() {
  request_stop();
  for (WatchedThread* thread : {&capture_thread_, &observe_thread_, &draw_thread_}) {
    if (thread->joinable()) thread->join();
  }
  if (parts_.angles) parts_.angles->stop();
}

bool CameraWorker::stop_unless_waiting(Duration patience) {
  request_stop();
  for (WatchedThread* thread : {&observe_thread_, &draw_thread_}) {
    if (thread->joinable()) thread->join();
  }
  if (parts_.angles) parts_.angles->stop();
  return !capture_thread_.joinable() || capture_thread_.join_unless_waiting(patience);
}

void CameraWorker::exchange(std::unique_ptr<ObserveStage> observe,
                            std::unique_ptr<DrawStage> draw) {
  std::lock_guard lock(mutex_);
  if (observe) next_observe_.swap(observe);
  if (draw) next_draw_.swap(draw);
}

void CameraWorker::renew(ObserveStage& stage) {
  std::unique_ptr<ObserveStage> next;
  {
    std::lock_guard lock(mutex_);
    next = std::move(next_observe_);
  }
  if (!next) return;
  stage = std::move(*next);
  hidden_.publish(nullptr);
  occluded_share_.set(0);
}

void CameraWorker::renew(DrawStage& stage) {
  std::unique_ptr<DrawStage> next;
  {
    std::lock_guard lock(mutex_);
    next = std::move(next_draw_);
  }
  if (!next) return;
  stage = std::move(*next);
  parts_.output->adopt(stage.names, stage.encoder);
}

void CameraWorker::note_problem(const char* cause, const Error& error) {
  const std::string problem = error.where == parts_.name ? error.text : error.message();
  Labels labels = camera_labels(parts_.name);
  labels["cause"] = cause;
  registry_
      .counter("sightline_source_lost_total",
               "Times the source could not be opened or was given up, by cause", labels)
      .add();
  present_gauge_.set(0);
  std::lock_guard lock(mutex_);
  // The same words again and again would fill the journal.
  if (problem != problem_) {
    log::warning({.camera = parts_.name, .cause = cause}, "{}: {}", parts_.name, problem);
  }
  problem_ = problem;
  open_ = false;
  rate_.set(0);
}

void CameraWorker::note_signal() {
  present_gauge_.set(1);
  std::lock_guard lock(mutex_);
  if (problem_.empty()) return;
  log::info({.camera = parts_.name}, "{}: signal is back", parts_.name);
  problem_.clear();
}

std::unique_ptr<FrameSource> CameraWorker::open_or_wait(std::stop_token stop, Heartbeat& heartbeat,
                                                        Backoff& backoff) {
  auto opened = parts_.open_source(stop);
  if (opened) {
    reopened_.add();
    const double rate = (*opened)->info().nominal_rate_hz;
    signal_.set_rate(rate > 0 ? rate : parts_.rate_hz);
    signal_.source_open(MonotonicClock::now());
    std::lock_guard lock(mutex_);
    open_ = true;
    if (problem_.empty()) log::info({.camera = parts_.name}, "{}: source open", parts_.name);
    return *std::move(opened);
  }
  if (stop.stop_requested()) return nullptr;  // given up for that
  signal_.source_gone();
  note_problem(cause_of(opened.error(), "absent"), opened.error());
  wait_to_reopen(stop, heartbeat, backoff, kTurn);
  return nullptr;
}

Result<SourceStep> CameraWorker::take(FrameSource& source, std::stop_token stop) {
  SL_ASSIGN(SourceStep step, source.next(stop, kTurn));
  if (step.kind == SourceStep::Kind::kFrame) {
    const FrameInfo& info = step.frame->info();
    if (info.width != parts_.width || info.height != parts_.height) {
      return make_error(ErrorCode::kInvalidInput, "",
                        "the camera sends {}x{} images, its calibration is for {}x{}: set the "
                        "camera to that size or calibrate at this one",
                        info.width, info.height, parts_.width, parts_.height);
    }
  } else if (step.kind == SourceStep::Kind::kTimeout) {
    const Time now = MonotonicClock::now();
    present_gauge_.set(signal_.lost_since(now) ? 0 : 1);
    if (parts_.reopen_when_stalled && signal_.stalled(now)) {
      return make_error(ErrorCode::kTimeout, "", "no frame for {:.1f} s; opening it again",
                        to_seconds(signal_.deadline()));
    }
  }
  return step;
}

void CameraWorker::lose_source(std::unique_ptr<FrameSource>& source, const Error& error) {
  signal_.source_gone();
  close_source(source);
  note_problem(cause_of(error, "gone"), error);
}

void CameraWorker::capture(std::stop_token stop, Heartbeat& heartbeat) {
  std::unique_ptr<FrameSource> source;
  capture_from(source, std::move(stop), heartbeat);
  close_source(source);
}

void CameraWorker::capture_from(std::unique_ptr<FrameSource>& source, std::stop_token stop,
                                Heartbeat& heartbeat) {
  // What opening and reading wait for, a device or a disk, is told by them (Waiting).
  Backoff backoff(parts_.name);
  while (!stop.stop_requested()) {
    heartbeat.beat();
    if (!source) {
      source = open_or_wait(stop, heartbeat, backoff);
      continue;
    }
    const auto step = take(*source, stop);
    if (!step) {
      lose_source(source, step.error());
      wait_to_reopen(stop, heartbeat, backoff, kTurn);
      continue;
    }
    if (step->kind == SourceStep::Kind::kEnd) {
      log::info({.camera = parts_.name}, "{}: end of the recording", parts_.name);
      std::lock_guard lock(mutex_);
      ended_ = true;
      return;
    }
    if (step->kind == SourceStep::Kind::kFrame) {
      backoff.reset();
      deliver(step->frame);
    }
  }
}

void CameraWorker::deliver(const FramePtr& frame) {
  const FrameInfo& info = frame->info();
  measure(info);
  if (parts_.on_captured) parts_.on_captured(frame);
  const bool damaged = info.status == FrameStatus::kDamaged;
  if (damaged) {
    damaged_.add();
  } else {
    signal_.good_frame(frame);
    note_signal();
  }
  if (!parts_.angles) {
    pass_on(frame);
  } else if (parts_.angles->push(frame)) {
    angles_dropped_->add();
  }
}

void CameraWorker::pass_on(const FramePtr& frame) {
  if (parts_.on_frame) parts_.on_frame(frame);
  if (frame->info().status == FrameStatus::kDamaged) return;
  if (observes_ && observe_slot_.put(frame)) observe_dropped_.add();
  if (parts_.output && parts_.output->wanted() && draw_slot_.put(frame)) draw_dropped_.add();
}

void CameraWorker::measure(const FrameInfo& info) {
  frames_.add();
  lost_.add(info.dropped_before);
  const Time last = last_arrival_.exchange(info.arrival);
  capture_age_.set(to_seconds(info.arrival - info.capture));
  captured_->observe(to_seconds(info.arrival - info.capture));
  capture_error_.set(to_seconds(info.capture_error));
  const double step = to_seconds(info.arrival - last);
  if (last == Time{} || step <= 0) return;
  const double rate = 1 / step;
  const double share = std::min(1.0, step);  // so that a second's frames weigh most
  rate_.set(rate_.value() + share * (rate - rate_.value()));
}

void CameraWorker::observe(std::stop_token stop, Heartbeat& heartbeat) {
  give_way(kObserveNice);
  ObserveStage stage = std::move(parts_.observe);
  while (!stop.stop_requested()) {
    heartbeat.beat();
    const auto frame = observe_slot_.take(stop, kTurn);
    renew(stage);
    if (!frame) continue;
    stage.board->read(observe_tracks_);
    observations_.clear();
    stage.observer->step(**frame, observe_tracks_, observations_);
    observe_age(*observed_, (*frame)->info().capture);
    for (Observation& observation : observations_) {
      stage.on_observation(std::move(observation));
    }
    if (stage.learner) learn(**frame, stage);
    if (stage.room) {
      if (auto look = stage.room->step(**frame, observe_tracks_)) stage.on_scene(*std::move(look));
    }
  }
}

void CameraWorker::learn(const Frame& frame, ObserveStage& stage) {
  stage.board->read(observe_tracks_);
  stage.learner->step(frame, observe_tracks_);
  hidden_.publish(stage.learner->hidden());
  const OcclusionLearner::StepResult& result = stage.learner->last_step();
  occluded_share_.set(result.cells > 0 ? static_cast<double>(result.hidden) / result.cells : 0);
}

bool CameraWorker::present() const {
  const auto lost_since = signal_.lost_since(MonotonicClock::now());
  std::lock_guard lock(mutex_);
  return open_ && (ended_ || !lost_since);
}

CameraStatus CameraWorker::status() const {
  CameraStatus status;
  status.frames = frames_.value();
  status.lost = lost_.value();
  status.capture_error_s = capture_error_.value();
  status.latency_s = capture_age_.value();
  status.draw_s = draw_seconds_.value();
  status.not_observed = observe_dropped_.value();
  status.not_drawn = draw_dropped_.value();
  const Time arrival = last_arrival_;
  if (arrival != Time{}) status.frame_age_s = to_seconds(MonotonicClock::now() - arrival);
  const auto lost_since = signal_.lost_since(MonotonicClock::now());
  std::lock_guard lock(mutex_);
  status.present = open_ && (ended_ || !lost_since);
  status.rate_hz = status.present ? rate_.value() : 0;
  if (!status.present) status.lost_since = lost_since.value_or(MonotonicClock::now());
  status.ended = ended_;
  status.problem = problem_;
  return status;
}

}  // namespace sightline
