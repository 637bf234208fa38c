// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/writer.hpp"

#include <ctime>
#include <set>

#include "record/manifest.hpp"
#include "record/media/camera_file.hpp"
#include "record/object_copy.hpp"
#include "record/recording_folder.hpp"
#include "sightline/base/files.hpp"
#include "sightline/base/log.hpp"
#include "sightline/record/axes_csv.hpp"

namespace sightline {

using namespace record;

namespace {

namespace fs = std::filesystem;

/// Flushing so often by capture time, and by image where they are rarer, keeps the loss of a
/// crash below half a second.
constexpr Duration kFlushEvery = std::chrono::milliseconds(400);

std::string rfc3339(int64_t utc_ns) {
  const std::time_t seconds = static_cast<std::time_t>(utc_ns / 1'000'000'000);
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:09}Z", parts.tm_year + 1900,
                     parts.tm_mon + 1, parts.tm_mday, parts.tm_hour, parts.tm_min, parts.tm_sec,
                     utc_ns % 1'000'000'000);
}

Status check_cameras(const RecordingWriterOptions& options, const std::string& where) {
  if (options.cameras.empty()) {
    return make_error(ErrorCode::kInvalidInput, where, "a recording needs a camera");
  }
  std::set<std::string> names;
  for (const auto& camera : options.cameras) {
    if (!is_plain_name(camera.name) || !names.insert(camera.name).second) {
      return make_error(ErrorCode::kInvalidInput, where,
                        "camera name '{}' is used twice or holds other characters than letters, "
                        "digits, '_', '-', '.'",
                        camera.name);
    }
    if (camera.width < 1 || camera.height < 1) {
      return make_error(ErrorCode::kInvalidInput, camera.name, "has a size of {} x {}",
                        camera.width, camera.height);
    }
  }
  return {};
}

/// What the writer keeps of one camera.
struct CameraState {
  std::unique_ptr<CameraFile> file;
  bool any = false;  ///< a row has been written
  uint32_t epoch = 0;
  uint64_t last_sequence = 0;
  uint64_t sequence_offset = 0;  ///< added, so that numbers grow over reopened sources too
  Time last_capture{};
  Time last_flush{};
  uint64_t left_out = 0;            ///< frames since the last row
  Time last_reading = Time::min();  ///< of its angles
};

class FolderWriter final : public RecordingWriter {
 public:
  FolderWriter(fs::path folder, const RecordingWriterOptions& options, OutFile rows)
      : folder_(std::move(folder)), sync_every_(options.sync_every), rows_(std::move(rows)) {}
  ~FolderWriter() override { (void)close(); }

  Status start(const RecordingWriterOptions& options) {
    RecordingManifest manifest;
    manifest.name = options.name.empty() ? folder_.filename().string() : options.name;
    manifest.start_monotonic_ns = to_ns(MonotonicClock::now());
    manifest.start_utc = rfc3339(utc_now_ns());
    for (const auto& camera : options.cameras) {
      const std::string name = camera.name + ".mkv";
      CameraState state;
      SL_ASSIGN(state.file, CameraFile::create(camera, options.raw_storage, folder_ / name));
      std::optional<PixelFormat> pixels;
      if (state.file->codec() == "rawvideo") pixels = camera.format;
      manifest.cameras.push_back(
          {camera.name, name, state.file->codec(), camera.width, camera.height, pixels, 0});
      cameras_.push_back(std::move(state));
    }
    SL_ASSIGN(manifest.objects, copy_objects(options.objects, folder_, manifest.left_out));
    if (options.scene) {
      SL_RETURN_IF_ERROR(copy_with_parts(*options.scene, folder_ / "scene", manifest.left_out));
      manifest.scene = (fs::path("scene") / options.scene->filename()).string();
    }
    for (const std::string& sentence : manifest.left_out) {
      log::warning("recording {}: {}", folder_.string(), sentence);
    }
    if (!options.calibration_toml.empty()) {
      SL_RETURN_IF_ERROR(
          write_file_atomically(folder_ / "calibration.toml", options.calibration_toml));
    }
    SL_RETURN_IF_ERROR(rows_.write("camera,sequence,capture_ns,arrival_ns,dropped_before\n"));
    return write_file_atomically(folder_ / "recording.toml", format_recording_toml(manifest));
  }

  Status append(const Frame& frame) override {
    if (status_) status_ = try_append(frame);
    return status_;
  }

  Status append_pose(const PoseLogRow& row) override {
    if (!status_) return status_;
    if (!poses_) {
      SL_ASSIGN(poses_, PoseLogWriter::create(folder_ / "poses.csv"));
    }
    return poses_->append(row);
  }

  Status flush() override {
    if (!status_) return status_;
    for (auto& camera : cameras_) {
      if (status_) status_ = camera.file->flush();
    }
    if (status_ && poses_) status_ = poses_->flush();
    return status_;
  }

  Status close() override {
    if (closed_) return status_;
    closed_ = true;
    for (auto& camera : cameras_) keep_first(camera.file->close());
    if (poses_) keep_first(poses_->close());
    if (axes_) {
      keep_first(axes_->sync());
      keep_first(axes_->close());
    }
    keep_first(rows_.sync());
    keep_first(rows_.close());
    return status_;
  }

  uint64_t written() const override { return written_; }
  uint64_t skipped() const override { return skipped_; }

 private:
  void keep_first(const Status& status) {
    if (status_) status_ = status;
  }

  /// As the camera said it: the calibration beside the frames has the offset.
  static Time stamp_of(const FrameInfo& info) { return info.capture - info.time_offset; }

  Status try_append(const Frame& frame) {
    const FrameInfo& info = frame.info();
    const Time stamp = stamp_of(info);
    if (closed_ || info.camera.index() >= cameras_.size()) {
      return make_error(ErrorCode::kInvalidInput, folder_.string(),
                        "a frame of camera {} came, but the recording {}", info.camera.index(),
                        closed_ ? "is closed" : "has no such camera");
    }
    CameraState& camera = cameras_[info.camera.index()];
    if (!start_) start_ = last_sync_ = stamp;
    if (info.place) SL_RETURN_IF_ERROR(append_axes(camera, *info.place));
    follow_epoch(camera, info);
    const uint64_t sequence = info.sequence + camera.sequence_offset;
    // The reader refuses numbers and times that do not grow.
    const bool in_order =
        !camera.any || (sequence > camera.last_sequence && stamp > camera.last_capture);
    if (!in_order) {
      camera.file->wait_for_keyframe_if_coded();
      return leave_out(camera);
    }
    SL_ASSIGN(const bool taken, camera.file->append(frame, stamp - *start_));
    if (!taken) return leave_out(camera);
    return finish_row(camera, info, sequence);
  }

  /// Frames bring the readings of the last moments, so that one that is dropped costs none.
  Status append_axes(CameraState& camera, const CameraPlace& place) {
    std::string rows;
    for (const AxisReading& reading : place.readings) {
      if (reading.stamp <= camera.last_reading) continue;
      camera.last_reading = reading.stamp;
      rows += format_axes_row(camera.file->camera().name, reading) + '\n';
    }
    if (rows.empty()) return {};
    if (!axes_) {
      SL_ASSIGN(axes_, OutFile::create(folder_ / "axes.csv", OutFile::Existing::kRefuse));
      SL_RETURN_IF_ERROR(axes_->write(std::string(kAxesHeader) + '\n'));
    }
    return axes_->write(rows);
  }

  static void follow_epoch(CameraState& camera, const FrameInfo& info) {
    if (camera.any && info.epoch != camera.epoch) {
      camera.sequence_offset = camera.last_sequence + 1 - info.sequence;  // wraps as it should
      camera.file->wait_for_keyframe_if_coded();
    }
    camera.epoch = info.epoch;
  }

  Status leave_out(CameraState& camera) {
    ++camera.left_out;
    ++skipped_;
    return {};
  }

  Status finish_row(CameraState& camera, const FrameInfo& info, uint64_t sequence) {
    const Time stamp = stamp_of(info);
    const uint64_t dropped = info.dropped_before + (camera.any ? camera.left_out : 0);
    SL_RETURN_IF_ERROR(
        rows_.write(fmt::format("{},{},{},{},{}\n", camera.file->camera().name, sequence,
                                to_ns(stamp), to_ns(info.arrival), dropped)));
    const bool flush_now = !camera.any || stamp - camera.last_flush >= kFlushEvery;
    camera.any = true;
    camera.left_out = 0;
    camera.last_sequence = sequence;
    camera.last_capture = stamp;
    ++written_;
    if (flush_now) {
      camera.last_flush = stamp;
      SL_RETURN_IF_ERROR(camera.file->flush());
    }
    return sync_if_due(stamp);
  }

  Status sync_if_due(Time now) {
    if (now - *last_sync_ < sync_every_) return {};
    last_sync_ = now;
    for (auto& camera : cameras_) {
      SL_RETURN_IF_ERROR(camera.file->flush());
      SL_RETURN_IF_ERROR(camera.file->sync());
      camera.last_flush = now;
    }
    if (poses_) SL_RETURN_IF_ERROR(poses_->flush());
    if (axes_) SL_RETURN_IF_ERROR(axes_->sync());
    return rows_.sync();
  }

  const fs::path folder_;
  const Duration sync_every_;
  OutFile rows_;
  std::optional<OutFile> axes_;  ///< once a camera turns
  std::vector<CameraState> cameras_;
  std::unique_ptr<PoseLogWriter> poses_;
  std::optional<Time> start_, last_sync_;
  Status status_;
  bool closed_ = false;
  uint64_t written_ = 0, skipped_ = 0;
};

}  // namespace

Result<std::unique_ptr<RecordingWriter>> RecordingWriter::create(
    const fs::path& folder, const RecordingWriterOptions& options) {
  // "OUT/" and "OUT" are the same folder.
  const fs::path clean = folder.has_filename() ? folder : folder.parent_path();
  SL_RETURN_IF_ERROR(check_cameras(options, clean.string()));
  SL_RETURN_IF_ERROR(make_recording_folder(clean));
  SL_ASSIGN(auto rows, OutFile::create(clean / "frames.csv", OutFile::Existing::kRefuse));
  auto writer = std::make_unique<FolderWriter>(clean, options, std::move(rows));
  SL_RETURN_IF_ERROR(writer->start(options));
  return std::unique_ptr<RecordingWriter>(std::move(writer));
}

}  // namespace sightline
