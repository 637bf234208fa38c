// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <stop_token>
#include <vector>

#include "sightline/config/installation.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {

/// Opens the sources that play recordings; cameras of one recording share its clock and so stay in
/// step, also when one of them is opened again. Any thread; nobody who asks holds up another for a
/// slow disk, but those who want the same recording wait for the first of them to have read it.
class ReplayLibrary {
 public:
  /// Makes the source of one camera. `payload`: frames carry their compressed bytes (for
  /// recording). After `stop` it gives up between two reads of the disk (kUnavailable).
  Result<std::unique_ptr<FrameSource>> open(const CameraConfig& camera, CameraId id, bool payload,
                                            const std::stop_token& stop = {});

  /// How the camera's images come, for the recording writer.
  Result<PixelFormat> payload_format(const CameraConfig& camera);

 private:
  struct Entry {
    std::shared_ptr<const Recording> recording;  ///< null: it is being read
    std::shared_ptr<const ReplayClock> clock;
  };
  Result<Entry> entry(const CameraConfig& camera, const std::stop_token& stop);
  /// The entry, if it is there or somebody else comes to have read it; null: read it, it is
  /// reserved.
  Result<Entry> entry_or_turn(const std::filesystem::path& folder, const std::stop_token& stop);
  void settle(const std::filesystem::path& folder, const Entry& made);

  std::mutex mutex_;  // never held while the disk is read
  std::condition_variable_any settled_;
  std::map<std::filesystem::path, Entry> entries_;
};

/// For VirtualReplay: by camera of the recording, the offset that its calibration has in the
/// installation (0: it is not in it).
std::vector<Duration> time_offsets(const Recording& recording, const Installation& installation);

/// What the angles of a camera are put into; null: it stands still.
std::shared_ptr<AxisHistory> axis_history_of(const CameraConfig& camera);
/// The same for the cameras of a recording. Of one that turns and has no angles in the recording
/// the log has a warning.
AxisHistories axis_histories(const Recording& recording, const Installation& installation);

}  // namespace sightline
