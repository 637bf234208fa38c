// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "camera_observer.hpp"
#include "object_search.hpp"
#include "point_collector.hpp"
#include "rig.hpp"
#include "sightline/fuse/estimator.hpp"
#include "sightline/record/overlay_video.hpp"
#include "sightline/record/pose_log.hpp"
#include "sightline/record/replay.hpp"

namespace sightline::cli {

/// What the pipeline came to after a whole recording.
struct ReplaySummary {
  size_t frames = 0;
  size_t sets = 0;
  std::map<std::string, std::map<std::string, size_t>> rows_by_state;  ///< object, state
  double observe_cpu_ms = 0;                                           ///< all frames together
  double fuse_cpu_ms = 0;
  size_t searches = 0;  ///< times an object was looked for everywhere
  double search_cpu_ms = 0;
  double learn_cpu_ms = 0;             ///< of what hides objects
  std::optional<PointSummary> points;  ///< if stereo points were asked for
};

struct ReplayOutputs {
  std::filesystem::path video;   ///< folder; empty: none
  std::filesystem::path png;     ///< folder; empty: none
  std::filesystem::path points;  ///< PLY of stereo points; empty: none
};

/// The rooms of the daemon in one thread on a recording's own clock: every frame, in the order
/// (capture time, camera), nothing dropped, no clock read. Two runs give the same bytes.
class ReplayPipeline {
 public:
  /// Cameras of the recording that the installation does not name are left out.
  static Result<std::unique_ptr<ReplayPipeline>> create(const Installation& installation,
                                                        std::shared_ptr<const Recording> recording,
                                                        PoseLogWriter* log,
                                                        const ReplayOutputs& outputs);

  /// Takes all frames of one capture time: observe, fuse, log, then draw with what is known now.
  Status step(const std::vector<FramePtr>& frames);
  Status finish();
  /// From now on stereo points are reconstructed from every set of frames.
  void want_points(const Installation& installation);
  /// The newest of them; null: none lately.
  ScenePointsPtr points_at(Time time) const;
  const ReplaySummary& summary() const { return summary_; }
  const Rig& rig() const { return rig_; }
  /// What is known now, one track per object.
  const std::vector<PoseTrackPtr>& tracks() const { return tracks_; }
  /// What a camera of the recording has learned to hide the objects; null: nothing.
  HiddenDepthPtr hidden(size_t camera) const;

 private:
  struct Camera {
    CameraId id;
    std::string name;
    std::unique_ptr<CameraObserver> observer;
    std::unique_ptr<OcclusionLearner> learner;  // null: nothing is learned
    std::unique_ptr<CameraRenderer> renderer;
    std::unique_ptr<OverlayVideoWriter> video;
    std::unique_ptr<PicturePool> pool;
    size_t drawn = 0;
  };

  ReplayPipeline() = default;
  Status add_camera(const Installation& installation, const RecordedCamera& recorded,
                    const ReplayOutputs& outputs);
  void observe(const std::vector<FramePtr>& frames);
  void search(const std::vector<FramePtr>& frames);
  Status fuse();
  void learn(const std::vector<FramePtr>& frames);
  void collect_points(const std::vector<FramePtr>& frames);
  Status draw(const std::vector<FramePtr>& frames);
  Status draw_one(const Frame& frame, Camera& camera);

  Rig rig_;
  std::vector<std::optional<Camera>> cameras_;  // by index in the recording
  std::vector<std::string> camera_names_;       // by CameraId
  std::vector<ObjectEstimator> estimators_;     // by ObjectId
  std::vector<PoseTrackPtr> tracks_;
  std::unique_ptr<ObjectSearch> search_;  // null: nothing to search for
  std::vector<Observation> observations_;
  std::vector<Observation> set_;
  std::vector<PoseAt> poses_;
  PoseLogWriter* log_ = nullptr;
  std::filesystem::path png_folder_;
  std::unique_ptr<PointCollector> collector_;  // null: no points wanted
  std::filesystem::path points_file_;
  std::vector<PointMark> marks_;
  ReplaySummary summary_;
};

}  // namespace sightline::cli
