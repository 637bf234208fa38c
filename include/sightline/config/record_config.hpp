// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <filesystem>
#include <vector>

#include "sightline/record/recording_sink.hpp"
#include "sightline/record/writer.hpp"

namespace sightline {

/// What is recorded, where, when, and how much of it stays.
struct RecordConfig {
  bool enabled = false;  ///< begins by itself
  /// Each recording makes a folder of its own in it; empty: none can be made.
  std::filesystem::path directory;
  /// What begins by itself, and where somebody does not say what.
  std::vector<RecordingKind> kinds{RecordingKind::kSource};
  RawStorage raw_storage = RawStorage::kRaw;
  ViewingOptions viewing;
  PoseFiles pose_files = PoseFiles::kCsv;
  bool pose_video = false;  ///< the streams' packets in poses.mcap, too
  /// What begins when an object is lost, from so long before to so long after it.
  std::vector<RecordingKind> on_lost;
  Duration before = std::chrono::seconds(5), after = std::chrono::seconds(20);
  double quota_gb = 0;  ///< of all recordings in `directory`, oldest go first; 0: none

  bool operator==(const RecordConfig&) const = default;

  static bool names(const std::vector<RecordingKind>& list, RecordingKind kind) {
    return std::ranges::find(list, kind) != list.end();
  }
};

}  // namespace sightline
