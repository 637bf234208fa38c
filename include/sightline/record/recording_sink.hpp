// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "sightline/base/result.hpp"
#include "sightline/model/stream_types.hpp"
#include "sightline/record/pose_log.hpp"

namespace sightline {

/// What a recording keeps (docs/recording.md). Each kind makes folders of its own.
enum class RecordingKind : uint8_t {
  kViewing,  ///< what the streams show: their H.264, not encoded again
  kSource,   ///< what the cameras send, replayable (writer.hpp)
  kPoses,    ///< what the estimator says
};
inline constexpr RecordingKind kRecordingKinds[] = {RecordingKind::kViewing, RecordingKind::kSource,
                                                    RecordingKind::kPoses};
/// "viewing", "source", "poses".
std::string_view to_string(RecordingKind kind);

/// One packet of a stream's encoder on its way into a file.
struct ViewPacket {
  std::string camera;
  int width = 0, height = 0;
  double rate_hz = 0;   ///< nominal
  uint64_t number = 0;  ///< one more with every packet of this camera; a gap: some were lost
  EncodedPacket packet;
};

/// One estimate with everything that is said of it.
struct PoseMessage {
  PoseLogRow row;
  int64_t utc_ns = 0;  ///< of row.time
  std::string json;    ///< as docs/api.md has a "pose" event, on one line
};

/// Writes the files of one recording into a folder that it makes. After a crash everything up to
/// the last flush() opens. Passive, one thread; calls may block on the disk. An error (disk full)
/// is final: later calls repeat it.
class RecordingSink {
 public:
  virtual ~RecordingSink() = default;  ///< close()s, ignoring errors
  /// Of the other kind: does nothing.
  virtual Status append(const ViewPacket&) { return {}; }
  virtual Status append(const PoseMessage&) { return {}; }
  /// Hands everything to the operating system, and to the disk where `sync`.
  virtual Status flush(bool sync) = 0;
  virtual Status close() = 0;
  virtual uint64_t written() const = 0;  ///< entries
};

struct ViewingOptions {
  /// What holds video goes on in another file at the first key frame after one of these.
  Duration segment = std::chrono::minutes(10);
  uint64_t segment_bytes = uint64_t{1} << 30;

  bool operator==(const ViewingOptions&) const = default;
};

/// Fragmented MP4 (H.264), one file per camera and segment: CAMERA-0001.mp4. Times are those of
/// capture, to the millisecond; frame number, exact time and poses are in each image's SEI unit.
/// After a gap in `number` a camera goes on with its next key frame; one whose parameter sets
/// change goes on in another file.
Result<std::unique_ptr<RecordingSink>> make_viewing_writer(const std::filesystem::path& folder,
                                                           const ViewingOptions& options);

enum class PoseFiles : uint8_t { kCsv, kMcap, kBoth };

/// poses.csv (pose_log.hpp), poses.mcap (docs/formats.md), or both. The streams' packets go into
/// poses.mcap, if there is one. It goes on in poses-0002.mcap, ...: with video as `parts` says,
/// which every camera enters with a key frame; without video after so many bytes.
Result<std::unique_ptr<RecordingSink>> make_poses_writer(const std::filesystem::path& folder,
                                                         PoseFiles files,
                                                         const ViewingOptions& parts = {});

/// A moment that somebody wants to find again.
struct RecordingMark {
  Time time{};
  int64_t utc_ns = 0;
  std::string text;
};
/// Appends a row to marks.csv of a recording's folder, synced. Commas, quotes and line breaks in
/// the text are kept as RFC 4180 has them.
Status append_mark(const std::filesystem::path& folder, const RecordingMark& mark);

}  // namespace sightline
