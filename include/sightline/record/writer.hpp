// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/record/pose_log.hpp"

namespace sightline {

/// How images that the camera does not compress are stored; both are lossless. Cost per frame is
/// in docs/decisions/0002-libav-for-recordings.md.
enum class RawStorage {
  kRaw,   ///< as they are: next to no CPU, 1.5 to 3 bytes per pixel
  kFfv1,  ///< about half the bytes, a large part of a core; gray, I420, NV12, YUYV, UYVY only
};

struct RecordingWriterCamera {
  std::string name;  ///< also the file's name: letters, digits, '_', '-', '.'
  /// Of the payload. Frames whose payload is empty are taken as images: say kI420.
  PixelFormat format = PixelFormat::kI420;
  int width = 0;
  int height = 0;
};

struct RecordingWriterOptions {
  std::string name;                            ///< of the recording; empty: the folder's name
  std::vector<RecordingWriterCamera> cameras;  ///< order = CameraId
  std::string calibration_toml;                ///< content of calibration.toml; empty: none
  /// Object files, copied into objects/ with what they and their meshes name, as far as it lies in
  /// the folder of the file that names it. The rest is logged and listed in recording.toml.
  std::vector<std::filesystem::path> objects;
  std::optional<std::filesystem::path> scene;
  RawStorage raw_storage = RawStorage::kRaw;
  Duration sync_every = std::chrono::seconds(1);  ///< fsync of all files, by capture time
};

/// Writes a recording folder so that it can be opened after a crash at any time, less at most the
/// last second. Passive and not thread-safe: the daemon calls it from one thread behind a bounded
/// queue; calls may block on the disk.
class RecordingWriter {
 public:
  /// Makes `folder` (its parent must exist). Refuses a folder that holds anything already.
  static Result<std::unique_ptr<RecordingWriter>> create(const std::filesystem::path& folder,
                                                         const RecordingWriterOptions& options);
  /// close()s, ignoring errors.
  virtual ~RecordingWriter() = default;

  /// Appends one frame: payload as it is where the camera compresses, else losslessly. H.264 starts
  /// at the first key frame; frames before it are left out and counted in skipped(). Damaged frames
  /// whose payload is empty are left out too. An error (disk full) is final: later calls repeat it.
  virtual Status append(const Frame& frame) = 0;
  /// Appends one row to poses.csv.
  virtual Status append_pose(const PoseLogRow& row) = 0;
  /// Hands everything so far to the operating system. append() does it twice a second by capture
  /// time; call it when cameras fall silent.
  virtual Status flush() = 0;
  /// Finishes the files and syncs them.
  virtual Status close() = 0;

  virtual uint64_t written() const = 0;  ///< frames
  virtual uint64_t skipped() const = 0;  ///< frames
};

}  // namespace sightline
