// SPDX-License-Identifier: Apache-2.0
#include "camera_unit.hpp"

#include <algorithm>
#include <condition_variable>

#include "sightline/base/log.hpp"
#include "sightline/base/thread.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kTurn = 200ms;     // longest wait of a thread without a look at its stop token
constexpr Duration kStallLimit = 5s;  // a thread silent for longer is hung
constexpr Duration kNoSignalPeriod = 500ms;  // between pictures while there is no signal

void sleep_unless_stopped(std::stop_token stop, Duration duration) {
  std::mutex mutex;
  std::condition_variable_any never;
  std::unique_lock lock(mutex);
  never.wait_for(lock, stop, duration, [] { return false; });
}

// Waiting for a camera is progress.
void wait_to_reopen(std::stop_token stop, Heartbeat& heartbeat, Backoff& backoff) {
  const Time end = MonotonicClock::now() + backoff.next();
  for (Time now = MonotonicClock::now(); now < end && !stop.stop_requested();
       now = MonotonicClock::now()) {
    heartbeat.beat();
    sleep_unless_stopped(stop, std::min<Duration>(end - now, kTurn));
  }
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

std::unique_ptr<CameraUnit> CameraUnit::start(CameraParts parts, Registry& registry,
                                              HeartbeatBoard& beats) {
  std::unique_ptr<CameraUnit> unit(new CameraUnit(std::move(parts), registry));
  CameraUnit* raw = unit.get();
  const std::string& name = raw->parts_.name;
  const auto launch = [&](const char* kind, void (CameraUnit::*body)(std::stop_token, Heartbeat&)) {
    const std::string thread_name = std::string(kind) + ":" + name;
    Heartbeat& heartbeat = beats.add(thread_name, kStallLimit);
    return start_thread(thread_name, [raw, body, &heartbeat](std::stop_token stop) {
      (raw->*body)(stop, heartbeat);
      heartbeat.retire();
    });
  };
  if (raw->parts_.observer) raw->observe_thread_ = launch("obs", &CameraUnit::observe);
  if (raw->parts_.output) raw->draw_thread_ = launch("draw", &CameraUnit::draw);
  raw->capture_thread_ = launch("cap", &CameraUnit::capture);
  return unit;
}

CameraUnit::CameraUnit(CameraParts parts, Registry& registry)
    : parts_(std::move(parts)),
      pictures_(parts_.width, parts_.height),
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
      hidden_share_(
          registry.gauge("sightline_hidden_share",
                         "Share of the objects' pixels that something was learned to hide",
                         camera_labels(parts_.name))) {
  signal_.set_rate(parts_.rate_hz);
}

void CameraUnit::request_stop() {
  capture_thread_.request_stop();
  observe_thread_.request_stop();
  draw_thread_.request_stop();
}

void CameraUnit::stop() {
  request_stop();
  for (std::jthread* thread : {&capture_thread_, &observe_thread_, &draw_thread_}) {
    if (thread->joinable()) thread->join();
  }
}

void CameraUnit::set_renderer(std::unique_ptr<CameraRenderer> renderer) {
  std::lock_guard lock(mutex_);
  next_renderer_ = std::move(renderer);
}

void CameraUnit::note_problem(const char* cause, const Error& error) {
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
  if (problem != problem_) log::warning("{}: {}", parts_.name, problem);
  problem_ = problem;
  open_ = false;
  rate_.set(0);
}

void CameraUnit::note_signal() {
  present_gauge_.set(1);
  std::lock_guard lock(mutex_);
  if (problem_.empty()) return;
  log::info("{}: signal is back", parts_.name);
  problem_.clear();
}

std::unique_ptr<FrameSource> CameraUnit::open_or_wait(std::stop_token stop, Heartbeat& heartbeat,
                                                      Backoff& backoff) {
  auto opened = parts_.open_source();
  if (opened) {
    reopened_.add();
    const double rate = (*opened)->info().nominal_rate_hz;
    signal_.set_rate(rate > 0 ? rate : parts_.rate_hz);
    signal_.source_open(MonotonicClock::now());
    std::lock_guard lock(mutex_);
    open_ = true;
    if (problem_.empty()) log::info("{}: source open", parts_.name);
    return *std::move(opened);
  }
  signal_.source_gone();
  note_problem(cause_of(opened.error(), "absent"), opened.error());
  wait_to_reopen(stop, heartbeat, backoff);
  return nullptr;
}

Result<SourceStep> CameraUnit::take(FrameSource& source, std::stop_token stop) {
  SL_ASSIGN(SourceStep step, source.next(stop, kTurn));
  if (step.kind == SourceStep::Kind::kFrame) {
    const FrameInfo& info = step.frame->info();
    if (info.width != parts_.width || info.height != parts_.height) {
      return make_error(ErrorCode::kInvalidInput, "",
                        "the camera sends {}x{} pictures, its calibration is for {}x{}: set the "
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

void CameraUnit::lose_source(std::unique_ptr<FrameSource>& source, const Error& error) {
  signal_.source_gone();
  source.reset();
  note_problem(cause_of(error, "gone"), error);
}

void CameraUnit::capture(std::stop_token stop, Heartbeat& heartbeat) {
  // Opening a device may take longer than a turn; the limit of the heartbeat covers it.
  std::unique_ptr<FrameSource> source;
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
      wait_to_reopen(stop, heartbeat, backoff);
      continue;
    }
    if (step->kind == SourceStep::Kind::kEnd) {
      log::info("{}: end of the recording", parts_.name);
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

void CameraUnit::deliver(const FramePtr& frame) {
  const FrameInfo& info = frame->info();
  measure(info);
  if (parts_.on_frame) parts_.on_frame(frame);
  if (info.status == FrameStatus::kDamaged) {
    damaged_.add();
    return;
  }
  signal_.good_frame(frame);
  note_signal();
  if (parts_.observer && observe_slot_.put(frame)) observe_dropped_.add();
  if (parts_.output && parts_.output->wanted() && draw_slot_.put(frame)) draw_dropped_.add();
}

void CameraUnit::measure(const FrameInfo& info) {
  frames_.add();
  lost_.add(info.dropped_before);
  const Time last = last_arrival_.exchange(info.arrival);
  capture_age_.set(to_seconds(info.arrival - info.capture));
  capture_error_.set(to_seconds(info.capture_error));
  const double step = to_seconds(info.arrival - last);
  if (last == Time{} || step <= 0) return;
  const double rate = 1 / step;
  const double share = std::min(1.0, step);  // so that a second's frames weigh most
  rate_.set(rate_.value() + share * (rate - rate_.value()));
}

void CameraUnit::observe(std::stop_token stop, Heartbeat& heartbeat) {
  while (!stop.stop_requested()) {
    heartbeat.beat();
    const auto frame = observe_slot_.take(stop, kTurn);
    if (!frame) continue;
    parts_.board->read(observe_tracks_);
    observations_.clear();
    parts_.observer->step(**frame, observe_tracks_, observations_);
    for (Observation& observation : observations_) {
      parts_.on_observation(std::move(observation));
    }
    if (parts_.learner) learn(**frame);
  }
}

void CameraUnit::learn(const Frame& frame) {
  parts_.board->read(observe_tracks_);
  parts_.learner->step(frame, observe_tracks_);
  hidden_.publish(parts_.learner->hidden());
  const OcclusionLearner::Look& look = parts_.learner->look();
  hidden_share_.set(look.cells > 0 ? static_cast<double>(look.hidden) / look.cells : 0);
}

void CameraUnit::draw(std::stop_token stop, Heartbeat& heartbeat) {
  std::unique_ptr<CameraRenderer> renderer = std::move(parts_.renderer);
  while (!stop.stop_requested()) {
    heartbeat.beat();
    const Duration until_card = next_no_signal_ - MonotonicClock::now();
    const bool card_next = until_card > Duration(0) && until_card < kTurn;
    const auto frame = draw_slot_.take(stop, card_next ? until_card : kTurn);
    if (!frame) {
      const auto lost_since = signal_.lost_since(MonotonicClock::now());
      if (lost_since && parts_.card && parts_.output->wanted()) draw_no_signal(*lost_since);
      parts_.output->report();
      continue;
    }
    {
      std::lock_guard lock(mutex_);
      if (next_renderer_) renderer = std::move(next_renderer_);
    }
    if (parts_.output->wanted()) draw_one(*frame, *renderer);
  }
}

void CameraUnit::draw_no_signal(Time since) {
  const Time now = MonotonicClock::now();
  if (now < next_no_signal_) return;
  next_no_signal_ = now + kNoSignalPeriod;
  if (!no_signal_.picture || since != no_signal_since_) {
    const SignalWatch::Last last = signal_.last();
    auto picture = std::make_shared<Picture>(parts_.width, parts_.height);
    const I420View shown = last.picture ? last.picture->view() : I420View{};
    parts_.card->draw(picture->mutable_view(), last.picture ? &shown : nullptr,
                      no_signal_text(parts_.name, utc_ns_of(since)));
    no_signal_.picture = std::move(picture);
    no_signal_.frame = last.frame;  // no fresh frame is claimed, and there are no poses
    no_signal_.frame.camera = parts_.id;
    no_signal_since_ = since;
  }
  no_signal_.shown = now;
  parts_.output->accept(no_signal_);
}

void CameraUnit::draw_one(const FramePtr& frame, CameraRenderer& renderer) {
  const Time start = MonotonicClock::now();
  std::shared_ptr<Picture> picture = pictures_.get();
  // The observer needs the shared picture anyway.
  if (parts_.observer) frame->i420();
  frame->copy_i420_to(picture->mutable_view());
  parts_.board->read(draw_tracks_);
  annotated_.frame = frame->info();
  const HiddenDepthPtr hidden = hidden_.read();
  renderer.draw(picture->mutable_view(), frame->info().capture, draw_tracks_, annotated_.poses,
                {hidden.get()});
  if (parts_.points) {
    marks_.clear();
    const ScenePointsPtr points = parts_.points(frame->info().capture);
    if (points) marks_of_points(*parts_.calibration, points->points, marks_);
    draw_point_marks(picture->mutable_view(), marks_, fit_depth_scale(marks_), kManyPoints);
  }
  annotated_.picture = std::move(picture);
  draw_seconds_.set(to_seconds(MonotonicClock::now() - start));
  parts_.output->accept(annotated_);
  annotated_.picture.reset();
}

CameraStatus CameraUnit::status() const {
  CameraStatus status;
  status.frames = frames_.value();
  status.lost = lost_.value();
  status.capture_error_s = capture_error_.value();
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
