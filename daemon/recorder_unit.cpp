// SPDX-License-Identifier: Apache-2.0
#include "recorder_unit.hpp"

#include <algorithm>

#include "sightline/base/log.hpp"
#include "sightline/base/thread.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr size_t kMaxQueuedBytes = size_t{256} << 20;

size_t bytes_of(const Frame& frame) {
  const auto pixels =
      static_cast<size_t>(frame.info().width) * static_cast<size_t>(frame.info().height);
  return std::max(frame.payload().bytes.size(), pixels * 3 / 2);
}

}  // namespace

Result<std::unique_ptr<RecorderUnit>> RecorderUnit::start(const std::filesystem::path& folder,
                                                          const RecordingWriterOptions& options,
                                                          std::vector<std::string> objects,
                                                          Registry& registry,
                                                          HeartbeatBoard& beats) {
  SL_ASSIGN(auto writer, RecordingWriter::create(folder, options));
  std::vector<std::string> cameras;
  for (const auto& camera : options.cameras) cameras.push_back(camera.name);
  std::unique_ptr<RecorderUnit> unit(new RecorderUnit(folder, std::move(writer), std::move(cameras),
                                                      std::move(objects), registry));
  Heartbeat& heartbeat = beats.add("record", 10s);  // a slow disk is not a hang
  unit->thread_ = start_thread("record", [raw = unit.get(), &heartbeat](std::stop_token stop) {
    raw->run(stop, heartbeat);
    heartbeat.retire();
  });
  log::info("recording to {}", folder.string());
  return unit;
}

RecorderUnit::RecorderUnit(std::filesystem::path folder, std::unique_ptr<RecordingWriter> writer,
                           std::vector<std::string> cameras, std::vector<std::string> objects,
                           Registry& registry)
    : folder_(std::move(folder)),
      writer_(std::move(writer)),
      cameras_(std::move(cameras)),
      objects_(std::move(objects)),
      dropped_(registry.counter("sightline_record_dropped_total",
                                "Frames and poses that the disk had no time for")),
      written_(registry.counter("sightline_record_frames_total", "Frames written")) {}

void RecorderUnit::push_entry(Entry entry) {
  if (const auto dropped = queue_.push(std::move(entry))) {
    dropped_.add();
    if (const auto* frame = std::get_if<FramePtr>(&*dropped)) queued_bytes_ -= bytes_of(**frame);
  }
}

void RecorderUnit::push(const FramePtr& frame) {
  const size_t bytes = bytes_of(*frame);
  if (queued_bytes_.fetch_add(bytes) + bytes > kMaxQueuedBytes) {
    queued_bytes_ -= bytes;
    dropped_.add();
    return;
  }
  push_entry(frame);
}

void RecorderUnit::push(const PoseEstimate& estimate) { push_entry(estimate); }

Status RecorderUnit::write(const Entry& entry) {
  if (const auto* frame = std::get_if<FramePtr>(&entry)) {
    queued_bytes_ -= bytes_of(**frame);
    if (!problem().empty()) return {};
    written_.add();
    return writer_->append(**frame);
  }
  const auto& estimate = std::get<PoseEstimate>(entry);
  return writer_->append_pose(
      make_pose_log_row(estimate, objects_.at(estimate.object.index()), cameras_));
}

void RecorderUnit::note(Status status) {
  if (status) return;
  std::lock_guard lock(mutex_);
  if (!status_) return;  // the first one is the cause
  log::error("recording stopped: {}", status.error().message());
  status_ = std::move(status);
}

void RecorderUnit::run(std::stop_token stop, Heartbeat& heartbeat) {
  // After the stop request: what is queued is still written, no more is waited for.
  for (;;) {
    heartbeat.beat();
    const bool stopping = stop.stop_requested();
    const auto entry = queue_.pop(stop, 250ms);
    if (!entry && stopping) break;
    note(entry ? write(*entry) : writer_->flush());
  }
  note(writer_->close());
}

Status RecorderUnit::stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
  std::lock_guard lock(mutex_);
  return status_;
}

std::string RecorderUnit::problem() const {
  std::lock_guard lock(mutex_);
  return status_ ? "" : status_.error().message();
}

}  // namespace sightline
