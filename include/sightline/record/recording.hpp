// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/geometry/axis_history.hpp"
#include "sightline/image/planes.hpp"
#include "sightline/record/recorded_rows.hpp"

namespace sightline {

/// One camera of a recording; its index in Recording::cameras is its CameraId.
struct RecordedCamera {
  std::string name;
  std::filesystem::path file;  ///< absolute or relative to the working directory
  std::string codec;           ///< "h264", "mpeg4", "mjpeg", "ffv1", "rawvideo"
  int width = 0;
  int height = 0;
  /// Of "rawvideo", where recording.toml says it: Matroska has no name for some of them.
  std::optional<PixelFormat> pixels;
  /// Capture order; row n belongs to the n-th displayed image of `file`. Both counts agree after
  /// open_recording(): a tail that only one of the two has is cut off (with a warning).
  RecordedRows rows;
  std::vector<AxisReading> axes = {};  ///< of axes.csv; empty: it stands still, or nobody knows

  /// Median time between rows; 0 with fewer than two rows.
  Duration frame_period() const;
};

/// recording.toml as written; paths relative to the recording's folder.
struct RecordingManifest {
  struct Camera {
    std::string name, file, codec;
    int width = 0, height = 0;
    std::optional<PixelFormat> pixels;  ///< of "rawvideo"
    int line = 0;                       ///< of its table in recording.toml
  };
  std::string name;
  std::string start_utc;  ///< RFC 3339; empty if the file does not say
  std::optional<int64_t> start_monotonic_ns;
  std::vector<Camera> cameras;
  std::vector<std::string> objects;
  std::optional<std::string> scene;
  std::vector<std::string> left_out;  ///< sentences: what object files named and was not copied
  std::vector<std::string> warnings;  ///< unknown keys and left_out, with line and column
};

/// A recording folder (docs/formats.md) that has been opened and checked.
struct Recording {
  std::filesystem::path path;
  std::string name;
  std::string start_utc;  ///< RFC 3339; empty if unknown
  std::vector<RecordedCamera> cameras;
  std::vector<std::filesystem::path> objects;  ///< object files
  std::optional<std::filesystem::path> scene;
  std::optional<std::filesystem::path> calibration;
  std::optional<std::filesystem::path> truth;
  std::optional<std::filesystem::path> poses;
  std::vector<std::string> warnings;  ///< what is odd but did not stop it from opening

  /// Earliest and latest capture time over all cameras; 0 without frames.
  Time first_capture() const;
  Time last_capture() const;
  size_t frame_count() const;  ///< over all cameras
};

enum class RecordingMode {
  kReplay,  ///< a missing tail of at most kToleratedTail is a warning (crash, pulled plug)
  kStrict,  ///< every difference between frames.csv and the videos is an error
};

/// How much of its end a recording may have lost and still be replayed.
inline constexpr Duration kToleratedTail = std::chrono::seconds(1);

/// Opens and checks a recording: recording.toml, frames.csv, and by demuxing (not decoding) that
/// every video is there, is what recording.toml says and has one image per row. A last line of
/// frames.csv that was cut off is dropped with a warning in both modes. Errors name file:line. All
/// of it is read from the disk, however slow; after `stop` it gives up (kUnavailable).
Result<Recording> open_recording(const std::filesystem::path& path,
                                 RecordingMode mode = RecordingMode::kReplay,
                                 const std::stop_token& stop = {});

/// Parses recording.toml. `where` is the file name for errors ("where:line:column").
Result<RecordingManifest> parse_recording_toml(std::string_view text, const std::string& where);

/// The rows of frames.csv, one vector per name in `cameras`. Refused, naming the line: a wrong
/// header, missing, negative or non-numeric columns, unknown cameras, and per camera duplicated or
/// unsorted sequences and capture times that do not grow. `warnings` may be null.
Result<std::vector<RecordedRows>> parse_frames_csv(std::string_view text, const std::string& where,
                                                   std::span<const std::string> cameras,
                                                   std::vector<std::string>* warnings);

/// The same from a file of any length, of which only the rows stay in memory (see RecordedRows).
/// Refused besides: what is no regular file, a line of more than 64 KiB, more than 64 MiB of zeros.
Result<std::vector<RecordedRows>> read_frames_csv(const std::filesystem::path& path,
                                                  std::span<const std::string> cameras,
                                                  std::vector<std::string>* warnings);

}  // namespace sightline
