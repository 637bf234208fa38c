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
constexpr Duration kNoSignalPeriod = 500ms;  // between images while there is no signal

// For the labels: a pose may be right and still lie beside the object in this camera's picture.
std::string_view notice_of(const DrawStage& stage) {
  switch (stage.calibration_state ? stage.calibration_state() : CalibrationState::kUnknown) {
    case CalibrationState::kKnocked:
      return "camera knocked";
    case CalibrationState::kDrifting:
      return "camera drifting";
    case CalibrationState::kDisputed:
      return "camera disputed";
    case CalibrationState::kUnfit:
      return "wrong picture";
    default:
      return {};
  }
}

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
  if (observes_) observed_ = &stage_latency(registry, parts_.name, "observed");
  if (parts_.output) drawn_ = &stage_latency(registry, parts_.name, "drawn");
}

void CameraWorker::request_stop() {
  if (parts_.head) parts_.head->request_stop();
  for (auto* thread : {&capture_thread_, &observe_thread_, &draw_thread_}) thread->request_stop();
}

void CameraWorker::stop() {
  request_stop();
  for (WatchedThread* thread : {&capture_thread_, &observe_thread_, &draw_thread_}) {
    if (thread->joinable()) thread->join();
  }
}

bool CameraWorker::stop_unless_waiting(Duration patience) {
  request_stop();
  for (WatchedThread* thread : {&observe_thread_, &draw_thread_}) {
    if (thread->joinable()) thread->join();
  }
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
  if (parts_.on_frame) parts_.on_frame(frame);
  if (info.status == FrameStatus::kDamaged) {
    damaged_.add();
    return;
  }
  signal_.good_frame(frame);
  note_signal();
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

void CameraWorker::draw(std::stop_token stop, Heartbeat& heartbeat) {
  DrawStage stage = std::move(parts_.draw);
  while (!stop.stop_requested()) {
    heartbeat.beat();
    const Duration until_slate = next_no_signal_ - MonotonicClock::now();
    const bool slate_next = until_slate > Duration(0) && until_slate < kTurn;
    const auto frame = draw_slot_.take(stop, slate_next ? until_slate : kTurn);
    renew(stage);
    if (!frame) {
      const auto lost_since = signal_.lost_since(MonotonicClock::now());
      if (lost_since && stage.slate && parts_.output->wanted()) {
        draw_no_signal(*lost_since, *stage.slate);
      }
      parts_.output->report();
      continue;
    }
    if (parts_.output->wanted()) draw_one(*frame, stage);
  }
}

void CameraWorker::draw_no_signal(Time since, NoSignalSlate& slate) {
  const Time now = MonotonicClock::now();
  if (now < next_no_signal_) return;
  next_no_signal_ = now + kNoSignalPeriod;
  if (!no_signal_.image || since != no_signal_since_) {
    const SignalWatch::Last last = signal_.last();
    auto image = std::make_shared<Image>(parts_.width, parts_.height);
    const I420View shown = last.image ? last.image->view() : I420View{};
    slate.draw(image->mutable_view(), last.image ? &shown : nullptr,
               no_signal_text(parts_.name, utc_ns_of(since)));
    no_signal_.image = std::move(image);
    no_signal_.frame = last.frame;  // no fresh frame is claimed, and there are no poses
    no_signal_.frame.camera = parts_.id;
    no_signal_since_ = since;
  }
  no_signal_.shown = now;
  parts_.output->accept(no_signal_);
}

void CameraWorker::draw_points(const MutableI420View& image, const FrameInfo& frame,
                               const DrawStage& stage) {
  const ScenePointsPtr points = stage.points(frame.capture);
  if (!points || (frame.place && !frame.place->trusted())) return;
  const CalibratedCamera& camera = *stage.calibration;
  const Rigid3& place = frame.place ? frame.place->world_from_camera : camera.world_from_camera;
  marks_.clear();
  marks_of_points(camera.model, place.inverse(), points->points, marks_);
  draw_point_marks(image, marks_, fit_depth_scale(marks_), kManyPoints);
}

void CameraWorker::draw_one(const FramePtr& frame, DrawStage& stage) {
  const Time start = MonotonicClock::now();
  // The observer needs the shared image anyway.
  if (observes_) frame->i420();
  offer_clean(*frame);
  if (!parts_.output->wants_annotated()) return;
  std::shared_ptr<Image> image = images_.get();
  frame->copy_i420_to(image->mutable_view());
  stage.board->read(draw_tracks_);
  annotated_.frame = frame->info();
  const OcclusionDepthPtr hidden = hidden_.read();
  stage.renderer->draw(image->mutable_view(), frame->info().capture, draw_tracks_, annotated_.poses,
                       {hidden.get(), notice_of(stage), frame->info().place.get()});
  if (stage.points) draw_points(image->mutable_view(), frame->info(), stage);
  annotated_.image = std::move(image);
  draw_seconds_.set(to_seconds(MonotonicClock::now() - start));
  observe_age(*drawn_, frame->info().capture);
  parts_.output->accept(annotated_);
  annotated_.image.reset();
}

void CameraWorker::offer_clean(const Frame& frame) {
  PictureSlot& pictures = parts_.output->pictures();
  if (!pictures.wanted(PictureKind::kClean)) return;
  std::shared_ptr<Image> clean = images_.get();
  frame.copy_i420_to(clean->mutable_view());
  pictures.offer(PictureKind::kClean, std::move(clean), frame.info());
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
