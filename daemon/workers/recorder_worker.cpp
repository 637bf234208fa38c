// SPDX-License-Identifier: Apache-2.0
#include "workers/recorder_worker.hpp"

#include <algorithm>

#include "recording/frame_bytes.hpp"
#include "recording/recordings_folder.hpp"
#include "sightline/base/log.hpp"

namespace sightline {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

namespace {

constexpr size_t kMaxQueuedBytes = size_t{256} << 20;
constexpr Duration kFirstWait = 2s, kMaxWait = 60s;  // between attempts to record
constexpr Duration kTurn = 250ms;
constexpr Duration kLastWrites = 1s;   // for what is queued at the end
constexpr Duration kStallLimit = 10s;  // besides what it waits for the disk
constexpr const char* kState = "sightline_recording";
constexpr const char* kStateHelp = "1 while recordings are in this state: recording, or stopped";

}  // namespace

Result<std::unique_ptr<RecorderWorker>> RecorderWorker::start(RecorderOptions options,
                                                              Registry& registry,
                                                              HeartbeatBoard& beats) {
  std::unique_ptr<RecorderWorker> worker(new RecorderWorker(std::move(options), registry));
  if (!worker->retries()) SL_RETURN_IF_ERROR(worker->open());
  worker->thread_ = WatchedThread(
      beats, "record", kStallLimit,
      [raw = worker.get()](std::stop_token stop, Heartbeat& beat) { raw->run(stop, beat); });
  return worker;
}

RecorderWorker::RecorderWorker(RecorderOptions options, Registry& registry)
    : options_(std::move(options)),
      wanted_(options_.wanted || !options_.folder.empty()),
      dropped_(registry.counter("sightline_record_dropped_total",
                                "Frames and poses that the disk had no time for")),
      written_(registry.counter("sightline_record_frames_total", "Frames written")),
      failures_(registry.counter("sightline_record_failures_total",
                                 "Times a recording could not be started, or stopped")),
      recording_(registry.gauge(kState, kStateHelp, {{"state", "recording"}})),
      stopped_(registry.gauge(kState, kStateHelp, {{"state", "stopped"}})) {
  for (const auto& camera : options_.writer.cameras) cameras_.push_back(camera.name);
}

void RecorderWorker::push_entry(Entry entry) {
  if (const auto dropped = queue_.push(std::move(entry))) {
    dropped_.add();
    if (dropped->frame) queued_bytes_ -= bytes_of(*dropped->frame);
  }
}

void RecorderWorker::push(const FramePtr& frame) {
  if (!writing_) return;
  const size_t bytes = bytes_of(*frame);
  if (queued_bytes_.fetch_add(bytes) + bytes > kMaxQueuedBytes) {
    queued_bytes_ -= bytes;
    dropped_.add();
    return;
  }
  push_entry({frame, {}});
}

void RecorderWorker::push(const PoseEstimate& estimate) {
  if (writing_) push_entry({nullptr, estimate});
}

Status RecorderWorker::open() {
  const Waiting wait("the disk");
  if (retries()) SL_RETURN_IF_ERROR(check_recording_space(options_.directory));
  const fs::path folder = retries()
                              ? new_recording_folder(options_.directory, RecordingKind::kSource)
                              : options_.folder;
  std::error_code fault;
  const bool was_there = fs::exists(folder, fault);
  if (fault) return recording_folder_error(folder, fault);
  auto writer = RecordingWriter::create(folder, options_.writer);
  if (!writer) {
    if (!was_there) fs::remove_all(folder, fault);
    return writer.error();
  }
  writer_ = *std::move(writer);
  log::info("recording to {}", folder.string());
  show(true, false);
  opened_ = MonotonicClock::now();
  written_here_ = 0;
  writing_ = true;
  std::lock_guard lock(mutex_);
  status_ = {};
  folder_ = folder;
  since_utc_ns_ = utc_now_ns();
  return {};
}

Status RecorderWorker::write(const Entry& entry) {
  if (entry.frame) {
    queued_bytes_ -= bytes_of(*entry.frame);
    if (!writer_) return {};
    written_.add();
    ++written_here_;
    return writer_->append(*entry.frame);
  }
  const PoseEstimate& estimate = entry.estimate;
  if (!writer_ || estimate.object.index() >= options_.objects.size()) return {};
  return writer_->append_pose(
      make_pose_log_row(estimate, options_.objects[estimate.object.index()], cameras_));
}

void RecorderWorker::fail(const Error& error) {
  writing_ = false;
  failures_.add();
  show(false, true);
  const bool empty = writer_ && writer_->written() == 0;
  writer_.reset();
  wait_ = std::clamp<Duration>(2 * wait_, kFirstWait, kMaxWait);
  // Never under the lock: who asks for the status does not wait for the disk.
  if (empty && retries()) remove_folder();
  std::lock_guard lock(mutex_);
  // The same words again and again would fill the journal.
  if (said_ != error.message()) {
    log::error({.cause = "disk"}, "recording stopped: {}", error.message());
  }
  said_ = error.message();
  status_ = error;
  folder_.clear();
}

void RecorderWorker::show(bool recording, bool stopped) {
  if (leaving_) return;
  recording_.set(recording ? 1 : 0);
  stopped_.set(stopped ? 1 : 0);
}

bool RecorderWorker::take(const std::stop_token& stop, Duration timeout, bool keep) {
  const std::optional<Entry> entry = queue_.pop(stop, timeout);
  if (!entry) return false;
  if (!keep) {
    if (entry->frame) queued_bytes_ -= bytes_of(*entry->frame);
    return true;
  }
  const Status done = write(*entry);
  if (!done) fail(done.error());
  return true;
}

void RecorderWorker::wait_to_open(const std::stop_token& stop, Heartbeat& heartbeat) {
  const Time end = MonotonicClock::now() + wait_;
  while (MonotonicClock::now() < end && !stop.stop_requested() && wanted()) {
    heartbeat.beat();
    show(false, !status().problem.empty());
    take(stop, kTurn, false);
  }
  if (stop.stop_requested() || !retries() || !wanted()) return;
  const Status opened = open();
  if (!opened) fail(opened.error());
}

void RecorderWorker::write_queued(const std::stop_token& stop, Heartbeat& heartbeat) {
  while (writer_ && !stop.stop_requested() && wanted()) {
    heartbeat.beat();
    show(true, false);
    // One that lasts was worth the attempt; one that breaks off at once is tried ever more seldom.
    if (MonotonicClock::now() - opened_ > kMaxWait) {
      wait_ = {};
      said_.clear();
    }
    if (take(stop, kTurn, true)) continue;
    const Status flushed = writer_->flush();
    if (!flushed) fail(flushed.error());
  }
}

void RecorderWorker::rest(const std::stop_token& stop, Heartbeat& heartbeat) {
  close();
  show(false, false);
  wait_ = {};
  {
    std::lock_guard lock(mutex_);
    if (!folder_.empty()) log::info("recording {} is finished", folder_.string());
    folder_.clear();
    status_ = {};
    said_.clear();
  }
  while (!wanted() && !stop.stop_requested()) {
    heartbeat.beat();
    take(stop, kTurn, false);
  }
}

void RecorderWorker::begin(std::optional<Duration> for_at_most) {
  if (!for_at_most) {
    wanted_ = true;
  } else {
    until_ = std::max(until_.load(), MonotonicClock::now() + *for_at_most);
  }
}

void RecorderWorker::end() {
  wanted_ = false;
  until_ = Time{};
}

void RecorderWorker::run(std::stop_token stop, Heartbeat& heartbeat) {
  while (!stop.stop_requested()) {
    if (!wanted()) {
      rest(stop, heartbeat);
    } else if (writer_) {
      write_queued(stop, heartbeat);
    } else {
      wait_to_open(stop, heartbeat);
    }
  }
  close();
}

// What is queued is still written, no more is waited for; on a slow disk not all of it.
void RecorderWorker::close() {
  writing_ = false;
  const Time end = MonotonicClock::now() + kLastWrites;
  size_t left = 0;
  std::stop_source stopped;
  stopped.request_stop();
  for (bool keep = true; take(stopped.get_token(), Duration(0), keep);) {
    if (!keep) ++left;
    keep = !retries() || MonotonicClock::now() < end;
  }
  if (left > 0) log::warning("recording: {} frames and poses were left out at its end", left);
  dropped_.add(left);
  if (!writer_) return;
  const bool empty = retries() && writer_->written() == 0;
  const Status closed = writer_->close();
  if (!closed) fail(closed.error());
  writer_.reset();
  if (empty) remove_folder();
}

void RecorderWorker::remove_folder() const {
  const fs::path folder = status().folder;
  if (folder.empty()) return;
  const Waiting wait("the disk");
  std::error_code ignored;
  fs::remove_all(folder, ignored);
}

Status RecorderWorker::stop() {
  request_stop();
  if (thread_.joinable()) thread_.join();
  std::lock_guard lock(mutex_);
  return status_;
}

bool RecorderWorker::stop_unless_waiting(Duration patience) {
  request_stop();
  if (!thread_.joinable()) return true;
  if (retries()) return thread_.join_unless_waiting(patience);
  thread_.join();
  return true;
}

RecordingStatus RecorderWorker::status() const {
  std::lock_guard lock(mutex_);
  return {folder_, status_ ? "" : status_.error().message(), since_utc_ns_};
}

}  // namespace sightline
