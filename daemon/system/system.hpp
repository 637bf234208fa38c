// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "cell/cell_worker.hpp"
#include "recording/zone_watch.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/pipeline/rig.hpp"
#include "system/servers.hpp"
#include "workers/action_worker.hpp"
#include "workers/calibration_keeper.hpp"
#include "workers/camera_worker.hpp"
#include "workers/frame_taps.hpp"
#include "workers/fusion_worker.hpp"
#include "workers/last_pose_keeper.hpp"
#include "workers/mqtt_worker.hpp"
#include "workers/virtual_camera_worker.hpp"

namespace sightline {

/// What a stop had to leave: threads that wait for a device or a disk. What they work on has to
/// outlive them; a process ends by _exit() then.
struct StopLeft {
  std::vector<std::string> what;  ///< "camera left", "the recording"
  bool recording = false;         ///< the recording is among them: its last second may be missing
};

/// The running system, one value: what belongs together is read together. Made beside the one that
/// it replaces and then published; it shares with it whatever did not change. Default: nothing
/// runs.
struct System {
  Installation installation{};
  std::shared_ptr<const Rig> rig{};
  std::shared_ptr<TrackBoard> board{};
  std::shared_ptr<TrackBoard> own_board{};  ///< what `fusion` estimates; mostly the same
  std::shared_ptr<FusionWorker> fusion{};
  std::shared_ptr<SceneReferences> rooms{};  ///< what each camera has seen of its room
  /// By CameraId: whose observations `fusion` has been given, also of cameras that have gone since.
  /// What it has learned of a camera goes by its CameraId.
  std::vector<std::string> fusion_cameras{};
  std::shared_ptr<FoundViews> found_views{};   ///< from `search` to the cameras
  std::shared_ptr<SearchWorker> search{};      ///< null: nothing to search for
  std::shared_ptr<PointsWorker> points{};      ///< null: off, or fewer than two cameras observe
  std::shared_ptr<RecorderWorker> recorder{};  ///< null: nothing is recorded
  std::shared_ptr<RtspService> rtsp{};         ///< null: not served
  std::shared_ptr<HttpService> http{};
  std::vector<std::shared_ptr<CameraWorker>> cameras{};  ///< by CameraId
  std::vector<std::shared_ptr<VirtualCameraWorker>> views{};
  std::shared_ptr<ActionWorker> actions{};           ///< null: none are sent
  std::shared_ptr<MqttWorker> mqtt{};                ///< null: no broker
  std::shared_ptr<CellWorker> cell{};                ///< null: the rig has one host
  std::shared_ptr<CalibrationKeeper> calibration{};  ///< null: nobody watches
  std::shared_ptr<ZoneWatch> zones{};                ///< never null while it runs
  std::shared_ptr<LastPoseKeeper> last_poses{};      ///< null: no object starts where it was last

  /// Somebody says where an object is: it is looked for there first, in the next ten seconds, if it
  /// has no pose then. Refused: an unknown name, an object that is not searched for, a camera that
  /// does not observe. From any thread, never waits.
  Status hint(const std::string& object, const SearchHint& hint) const;
  /// Somebody says that its track is wrong: it is dropped, and the object searched for anew.
  Status forget(const std::string& object) const;

  /// Sources first, streams last; waits for all but, after a moment, for what waits for a device or
  /// a disk: that is left, and said in `left`. The recording's error, if it had one.
  Status stop(StopLeft& left) const;
};

}  // namespace sightline
