// SPDX-License-Identifier: Apache-2.0
#include "recording/recording_sink_worker.hpp"

#include <algorithm>

#include "recording/recordings_folder.hpp"
#include "sightline/base/log.hpp"
#include "web/pose_json.hpp"

namespace sightline {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

namespace {

// Of packets; poses are small, and never give way to them.
constexpr size_t kMaxQueuedBytes = size_t{64} << 20;
constexpr size_t kMaxQueuedPackets = 3072;  // of the queue's 4096
constexpr size_t kMaxRingBytes = size_t{256} << 20;
// Beside what is asked for, so that a key frame is there: the longest way from one to the next at
// the encoder's default.
constexpr Duration kToKeyframe = 2500ms;
constexpr Duration kFirstWait = 2s, kMaxWait = 60s;
constexpr Duration kTurn = 200ms;
constexpr Duration kFlushEvery = 400ms, kSyncEvery = 1s;
constexpr Duration kStallLimit = 10s;  // besides what it waits for the disk
constexpr int kLastWrites = 4096;      // entries, at the end

Labels labels(RecordingKind kind) { return {{"kind", std::string(to_string(kind))}}; }

}  // namespace

std::shared_ptr<RecordingSinkWorker> RecordingSinkWorker::start(RecordingKind kind,
                                                                Registry& registry,
                                                                HeartbeatBoard& beats) {
  std::shared_ptr<RecordingSinkWorker> recorder(new RecordingSinkWorker(kind, registry));
  recorder->thread_ = WatchedThread(
      beats, "rec:" + recorder->name_, kStallLimit,
      [raw = recorder.get()](std::stop_token stop, Heartbeat& beat) { raw->run(stop, beat); });
  return recorder;
}

RecordingSinkWorker::RecordingSinkWorker(RecordingKind kind, Registry& registry)
    : kind_(kind),
      name_(to_string(kind)),
      takes_video_(kind == RecordingKind::kViewing),
      dropped_(registry.counter("sightline_recording_dropped_total",
                                "Packets and poses that the disk had no time for", labels(kind))),
      written_counter_(registry.counter("sightline_recording_written_total",
                                        "Packets and poses that were written", labels(kind))),
      failures_(registry.counter("sightline_recording_failures_total",
                                 "Times a recording could not be started, or stopped",
                                 labels(kind))),
      running_(registry.gauge("sightline_recording_running", "1 while something is recorded",
                              labels(kind))),
      failing_(registry.gauge("sightline_recording_failing",
                              "1 while something should be recorded and is not", labels(kind))) {}

void RecordingSinkWorker::configure(RecordingSinkSettings settings) {
  const std::lock_guard lock(mutex_);
  settings_ = std::move(settings);
  takes_video_ = settings_.video;
  ++settings_version_;
  update_wants();
}

void RecordingSinkWorker::update_wants() {
  wants_ = !settings_.directory.empty() && (order_.wanted || settings_.before > 0ns);
}

void RecordingSinkWorker::begin(std::optional<Duration> for_at_most, const std::string& why) {
  const std::lock_guard lock(mutex_);
  const bool more = order_.wanted;
  if (!for_at_most) {
    order_ = {true, std::nullopt};
  } else if (!more || order_.until) {
    const Time until = MonotonicClock::now() + *for_at_most;
    order_ = {true, std::max(order_.until.value_or(until), until)};
  }
  if (!more) {
    log::info({.cause = "start"}, "recording {}: starts ({})", name_, why);
    said_.clear();
    ++begun_;
  }
  update_wants();
}

void RecordingSinkWorker::end(const std::string& why) {
  const std::lock_guard lock(mutex_);
  if (!order_.wanted) return;
  log::info({.cause = "stop"}, "recording {}: ends ({})", name_, why);
  order_ = {};
  problem_.clear();
  update_wants();
}

RecordingSinkStatus RecordingSinkWorker::status() const {
  const std::lock_guard lock(mutex_);
  return {order_.wanted, folder_, problem_, since_utc_ns_, written_, dropped_.value()};
}

void RecordingSinkWorker::push_entry(Entry entry) {
  if (const auto gone = queue_.push(std::move(entry))) {
    queued_bytes_ -= gone->bytes;
    dropped_.add();
  }
}

void RecordingSinkWorker::push(ViewPacket packet) {
  if (log_) log_->push(packet);
  if (!wants_ || !takes_video_) return;
  const Time time = packet.packet.capture;
  const size_t bytes = packet.packet.bytes->size();
  if (queued_bytes_.fetch_add(bytes) + bytes > kMaxQueuedBytes ||
      queue_.size() >= kMaxQueuedPackets) {
    queued_bytes_ -= bytes;
    dropped_.add();
    return;
  }
  push_entry({std::move(packet), time, bytes});
}

void RecordingSinkWorker::push(PoseFeed::Entry pose) {
  if (!wants_) return;
  const Time time = pose.estimate.time;
  push_entry({std::move(pose), time, 0});
}

void RecordingSinkWorker::run(const std::stop_token& stop, Heartbeat& heartbeat) {
  while (!stop.stop_requested()) {
    heartbeat.beat();
    step(stop);
  }
  for (int i = 0; writer_ && i < kLastWrites; ++i) {
    const auto entry = queue_.pop(stop, 0ns);
    if (!entry) break;
    if (const Status done = write(*entry); !done) fail(done.error());
  }
  close("the program ends");
}

void RecordingSinkWorker::step(const std::stop_token& stop) {
  const Time now = MonotonicClock::now();
  const bool wanted = follow_orders(now);
  running_.set(writer_ ? 1 : 0);
  failing_.set(wanted && !writer_ ? 1 : 0);
  auto entry = queue_.pop(stop, kTurn);
  if (entry) {
    queued_bytes_ -= entry->bytes;
    if (!writer_) {
      keep(*std::move(entry));
    } else if (const Status done = write(*entry); !done) {
      fail(done.error());
    }
  }
  flush_if_due(MonotonicClock::now());
}

bool RecordingSinkWorker::follow_orders(Time now) {
  bool changed = false, wanted = false;
  {
    const std::lock_guard lock(mutex_);
    changed = now_version_ != settings_version_;
    if (changed) now_ = settings_;
    now_version_ = settings_version_;
    if (order_.until && now >= *order_.until) {
      order_ = {};
      problem_.clear();
      update_wants();
    }
    wanted = order_.wanted && !now_.directory.empty();
  }
  if (writer_ && (changed || !wanted)) close(changed ? "reloaded" : "stopped");
  if (!wanted) {
    wait_ = {};
    next_try_ = {};
  } else if (!writer_ && now >= next_try_) {
    if (const Status opened = open(); !opened) fail(opened.error());
  }
  return wanted;
}

Status RecordingSinkWorker::open() {
  const Waiting wait("the disk");
  SL_RETURN_IF_ERROR(check_recording_space(now_.directory));
  const fs::path folder = new_recording_folder(now_.directory, kind_);
  auto made = now_.open(folder);
  if (!made) {
    std::error_code ignored;
    fs::remove(folder, ignored);  // if it is empty
    return made.error();
  }
  writer_ = *std::move(made);
  written_ = 0;
  opened_ = last_flush_ = last_sync_ = MonotonicClock::now();
  log::info("recording {} to {}", name_, folder.string());
  {
    const std::lock_guard lock(mutex_);
    folder_ = folder;
    problem_.clear();
    since_utc_ns_ = utc_now_ns();
  }
  return write_ring();
}

// What was kept from before, in the order of time.
Status RecordingSinkWorker::write_ring() {
  std::deque<Entry> packets, poses;
  packets.swap(packet_ring_);
  poses.swap(pose_ring_);
  ring_bytes_ = 0;
  while (!packets.empty() || !poses.empty()) {
    const bool packet_first =
        !packets.empty() && (poses.empty() || packets.front().time <= poses.front().time);
    std::deque<Entry>& from = packet_first ? packets : poses;
    SL_RETURN_IF_ERROR(write(from.front()));
    from.pop_front();
  }
  return {};
}

Status RecordingSinkWorker::write(const Entry& entry) {
  Status done;
  if (const auto* packet = std::get_if<ViewPacket>(&entry.what)) {
    done = writer_->append(*packet);
  } else {
    const auto& [estimate, names] = std::get<PoseFeed::Entry>(entry.what);
    const size_t index = estimate.object.index();
    const std::string object = index < names->objects.size() ? names->objects[index] : "";
    done = writer_->append({make_pose_log_row(estimate, object, names->cameras),
                            utc_ns_of(estimate.time), pose_event_json(estimate, *names)});
  }
  written_counter_.add(writer_->written() - written_);
  written_ = writer_->written();
  return done;
}

void RecordingSinkWorker::keep(Entry entry) {
  if (now_.before <= 0ns) return;
  const Time oldest = entry.time - now_.before - kToKeyframe;
  ring_bytes_ += entry.bytes;
  const bool is_packet = std::holds_alternative<ViewPacket>(entry.what);
  (is_packet ? packet_ring_ : pose_ring_).push_back(std::move(entry));
  while (!pose_ring_.empty() && pose_ring_.front().time < oldest) pose_ring_.pop_front();
  while (!packet_ring_.empty() &&
         (packet_ring_.front().time < oldest || ring_bytes_ > kMaxRingBytes)) {
    ring_bytes_ -= packet_ring_.front().bytes;
    packet_ring_.pop_front();
  }
}

void RecordingSinkWorker::flush_if_due(Time now) {
  if (!writer_ || now - last_flush_ < kFlushEvery) return;
  const bool sync = now - last_sync_ >= kSyncEvery;
  last_flush_ = now;
  if (sync) last_sync_ = now;
  // One that lasts was worth the attempt; one that breaks off at once is tried ever more seldom.
  if (now - opened_ > kMaxWait) wait_ = {};
  if (const Status done = writer_->flush(sync); !done) fail(done.error());
}

void RecordingSinkWorker::close(const char* why) {
  if (!writer_) return;
  fs::path folder;
  {
    const std::lock_guard lock(mutex_);
    folder = std::exchange(folder_, {});
  }
  const bool empty = writer_->written() == 0;
  const Status closed = writer_->close();
  writer_.reset();
  running_.set(0);
  if (!closed) log::error("recording {}: {}", name_, closed.error().message());
  if (empty) {
    const Waiting wait("the disk");
    std::error_code ignored;
    fs::remove_all(folder, ignored);
  }
  log::info("recording {}: {} is finished ({})", name_, folder.string(), why);
}

void RecordingSinkWorker::fail(const Error& error) {
  failures_.add();
  const bool empty = writer_ && writer_->written() == 0;
  writer_.reset();
  wait_ = std::clamp<Duration>(2 * wait_, kFirstWait, kMaxWait);
  next_try_ = MonotonicClock::now() + wait_;
  fs::path folder;
  {
    const std::lock_guard lock(mutex_);
    folder = std::exchange(folder_, {});
    // The same words again and again would fill the journal.
    if (said_ != error.message()) {
      log::error({.cause = "disk"}, "recording {} stopped: {}", name_, error.message());
    }
    said_ = error.message();
    problem_ = order_.wanted ? error.message() : "";
  }
  if (!empty || folder.empty()) return;
  const Waiting wait("the disk");
  std::error_code ignored;
  fs::remove_all(folder, ignored);
}

bool RecordingSinkWorker::stop_unless_waiting(Duration patience) {
  thread_.request_stop();
  return !thread_.joinable() || thread_.join_unless_waiting(patience);
}

}  // namespace sightline
