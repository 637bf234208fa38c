// SPDX-License-Identifier: Apache-2.0
#include "recording/image_recording.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "recording/frame_bytes.hpp"
#include "sightline/base/log.hpp"
#include "sightline/base/thread.hpp"
#include "workers/backoff.hpp"
#include "workers/wait_to_reopen.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace fs = std::filesystem;

namespace {

constexpr Duration kTurn = 200ms;
constexpr size_t kMaxQueuedBytes = size_t{256} << 20;

// Before the cameras are asked; the folder itself is made when there is something to write.
Status check_folder(const fs::path& folder) {
  // "OUT/" and "OUT" are the same folder.
  const fs::path clean = folder.has_filename() ? folder : folder.parent_path();
  std::error_code fault;
  if (fs::exists(clean, fault)) {
    if (fs::is_directory(clean, fault) && fs::is_empty(clean, fault)) return {};
    return make_error(ErrorCode::kInvalidInput, clean.string(),
                      "is not empty; recordings are never overwritten, give another folder");
  }
  const fs::path parent = clean.parent_path();
  if (parent.empty() || fs::is_directory(parent, fault)) return {};
  return make_error(ErrorCode::kIo, clean.string(), "cannot make this folder: there is no {}",
                    parent.string());
}

}  // namespace

Result<std::unique_ptr<ImageRecording>> ImageRecording::start(const Installation& installation,
                                                              const fs::path& folder) {
  SL_RETURN_IF_ERROR(check_folder(folder));
  std::unique_ptr<ImageRecording> recording(new ImageRecording(installation, folder));
  ImageRecording* raw = recording.get();
  raw->writing_ = start_thread(
      "record", [raw](const std::stop_token& stop) { raw->write(stop); },
      [raw](const std::string& what) {
        std::lock_guard lock(raw->mutex_);
        raw->status_ = make_error(ErrorCode::kInternal, "recording", "{}", what);
      });
  for (size_t i = 0; i < raw->cameras_.size(); ++i) {
    raw->capturing_.push_back(start_thread(
        "cap:" + raw->cameras_[i].name,
        [raw, i](const std::stop_token& stop) { raw->capture(i, stop); },
        [raw, i](const std::string& what) { raw->note(i, what); }));
  }
  return recording;
}

ImageRecording::ImageRecording(const Installation& installation, std::filesystem::path folder)
    : name_(installation.name),
      folder_(std::move(folder)),
      raw_storage_(installation.record.raw_storage) {
  for (size_t i = 0; i < installation.cameras.size(); ++i) {
    const CameraConfig& camera = installation.cameras[i];
    Camera& own = cameras_.emplace_back();
    own.name = camera.name;
    own.open = sources_.opener(camera, CameraId(static_cast<uint32_t>(i)), true);
  }
}

ImageRecording::~ImageRecording() { (void)stop(); }

void ImageRecording::note(size_t index, const std::string& problem) {
  std::lock_guard lock(mutex_);
  Camera& camera = cameras_[index];
  // The same words again and again would fill the terminal.
  if (!problem.empty() && problem != camera.problem) {
    log::warning({.camera = camera.name}, "{}: {}", camera.name, problem);
  }
  camera.problem = problem;
}

bool ImageRecording::take(size_t index, const Frame& frame) {
  const PixelFormat format =
      frame.payload().bytes.empty() ? PixelFormat::kI420 : frame.info().format;
  if (frame.payload().bytes.empty() && frame.info().status == FrameStatus::kDamaged) return false;
  const int width = frame.info().width, height = frame.info().height;
  std::string problem;
  {
    std::lock_guard lock(mutex_);
    if (over_) return false;
    Camera& camera = cameras_[index];
    if (!camera.first) camera.first = RecordingWriterCamera{camera.name, format, width, height};
    const RecordingWriterCamera& first = *camera.first;
    // Its file is of one kind of image; the other cameras go on.
    if (width != first.width || height != first.height) {
      problem = fmt::format("now sends {}x{} pixels, not {}x{}: these images are left out", width,
                            height, first.width, first.height);
    } else if (first.format != PixelFormat::kI420 && format != first.format) {
      problem = "now sends another kind of image than at first: these images are left out";
    }
  }
  note(index, problem);
  return problem.empty() && complete();
}

void ImageRecording::push(FramePtr frame) {
  const size_t bytes = bytes_of(*frame);
  if (queued_bytes_.fetch_add(bytes) + bytes > kMaxQueuedBytes) {
    queued_bytes_ -= bytes;
    ++dropped_;
    return;
  }
  if (const auto gone = queue_.push(std::move(frame))) {
    queued_bytes_ -= bytes_of(**gone);
    ++dropped_;
  }
}

void ImageRecording::capture(size_t index, const std::stop_token& stop) {
  std::unique_ptr<FrameSource> source;
  Backoff backoff(cameras_[index].name);
  const auto lose = [&](const Error& error) {
    source.reset();
    note(index, error.where == cameras_[index].name ? error.text : error.message());
    sleep_unless_stopped(stop, backoff.next());
  };
  while (!stop.stop_requested()) {
    if (!source) {
      auto opened = cameras_[index].open(stop);
      if (!opened) {
        if (!stop.stop_requested()) lose(opened.error());
        continue;
      }
      source = *std::move(opened);
    }
    auto step = source->next(stop, kTurn);
    if (!step) {
      lose(step.error());
      continue;
    }
    if (step->kind == SourceStep::Kind::kEnd) {
      std::lock_guard lock(mutex_);
      cameras_[index].ended = true;
      return;
    }
    if (step->kind != SourceStep::Kind::kFrame) continue;
    backoff.reset();
    if (take(index, *step->frame)) push(std::move(step->frame));
  }
}

bool ImageRecording::complete() const {
  std::lock_guard lock(mutex_);
  return std::ranges::all_of(cameras_, [](const Camera& c) { return c.first.has_value(); });
}

Status ImageRecording::open_writer() {
  RecordingWriterOptions options;
  options.name = name_;
  options.raw_storage = raw_storage_;
  {
    std::lock_guard lock(mutex_);
    for (const Camera& camera : cameras_) options.cameras.push_back(*camera.first);
  }
  SL_ASSIGN(writer_, RecordingWriter::create(folder_, options));
  log::info("recording to {}", folder_.string());
  return {};
}

Status ImageRecording::write_one(const FramePtr& frame) {
  queued_bytes_ -= bytes_of(*frame);
  if (!writer_) SL_RETURN_IF_ERROR(open_writer());
  SL_RETURN_IF_ERROR(writer_->append(*frame));
  std::lock_guard lock(mutex_);
  written_ = writer_->written();
  return {};
}

void ImageRecording::write(const std::stop_token& stop) {
  std::stop_source now;
  now.request_stop();
  while (!stop.stop_requested() && !complete()) sleep_unless_stopped(stop, kTurn / 4);
  if (!complete()) return;
  // What is queued at the stop is still written.
  while (true) {
    const bool last = stop.stop_requested();
    const auto frame = last ? queue_.pop(now.get_token(), Duration(0)) : queue_.pop(stop, kTurn);
    if (!frame && last) return;
    Status done;
    if (frame) {
      done = write_one(*frame);
    } else if (writer_) {
      done = writer_->flush();
    }
    if (done) continue;
    std::lock_guard lock(mutex_);
    status_ = done;
    over_ = true;
    return;
  }
}

bool ImageRecording::ended() const {
  std::lock_guard lock(mutex_);
  return queue_.size() == 0 &&
         std::ranges::all_of(cameras_, [](const Camera& c) { return c.ended; });
}

std::string ImageRecording::problem() const {
  std::lock_guard lock(mutex_);
  return status_ ? "" : status_.error().message();
}

std::string ImageRecording::waits_for() const {
  std::lock_guard lock(mutex_);
  for (const Camera& camera : cameras_) {
    if (camera.first) continue;
    return "camera " + camera.name + ": " +
           (camera.problem.empty() ? "no image yet" : camera.problem);
  }
  return {};
}

uint64_t ImageRecording::written() const {
  std::lock_guard lock(mutex_);
  return written_;
}

Status ImageRecording::stop() {
  for (std::jthread& thread : capturing_) thread.request_stop();
  for (std::jthread& thread : capturing_) {
    if (thread.joinable()) thread.join();
  }
  writing_.request_stop();
  if (writing_.joinable()) writing_.join();
  if (writer_) {
    const Status closed = writer_->close();
    writer_.reset();
    std::lock_guard lock(mutex_);
    if (status_ && !closed) status_ = closed;
  }
  const std::string missing = waits_for();
  std::lock_guard lock(mutex_);
  if (!status_) return status_;
  if (missing.empty()) return {};
  return make_error(ErrorCode::kUnavailable, missing,
                    "nothing was recorded: each camera has to send an image first");
}

}  // namespace sightline
