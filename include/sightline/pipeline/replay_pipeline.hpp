// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sightline/pipeline/point_collector.hpp"
#include "sightline/pipeline/rig_parts.hpp"
#include "sightline/pipeline/tracking_chain.hpp"
#include "sightline/pipeline/turning/angle_refiner.hpp"
#include "sightline/record/overlay_video.hpp"
#include "sightline/record/pose_log.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {

/// What the pictures of a camera that turns said of its angles.
struct TurnSummary {
  std::string camera;
  size_t frames = 0, used = 0;
  RefinerStatus last;  ///< of the last frame
};

/// What the pipeline came to after a whole recording.
struct ReplaySummary {
  size_t frames = 0;
  size_t sets = 0;
  std::map<std::string, std::map<std::string, size_t>> rows_by_state;  ///< object, state
  double observe_cpu_ms = 0;                                           ///< all frames together
  double fuse_cpu_ms = 0;
  size_t searches = 0;  ///< times an object was looked for everywhere
  double search_cpu_ms = 0;
  SearchTiming search_timing;
  double search_time_ms = 0;  ///< that searches have been charged with, on the recording's clock
  double learn_cpu_ms = 0;    ///< of what hides objects
  double turn_cpu_ms = 0;     ///< of angles by pictures
  size_t turned_frames = 0;   ///< frames that it was asked of
  std::vector<TurnSummary> turns;      ///< by camera that turns; complete after finish()
  std::optional<PointSummary> points;  ///< if stereo points were asked for
};

struct ReplayOutputs {
  std::filesystem::path video;   ///< folder; empty: none
  std::filesystem::path png;     ///< folder; empty: none
  std::filesystem::path points;  ///< PLY of stereo points; empty: none
};

/// The rooms of the daemon in one thread on a recording's own clock: every frame, in the order
/// (capture time, camera), nothing dropped, no clock read: searches take as long as their work is
/// worth (search_cost.hpp). Two runs give the same bytes.
class ReplayPipeline {
 public:
  /// Cameras of the recording that the installation does not name are left out.
  static Result<std::unique_ptr<ReplayPipeline>> create(const Installation& installation,
                                                        std::shared_ptr<const Recording> recording,
                                                        PoseLogWriter* log,
                                                        const ReplayOutputs& outputs,
                                                        const SearchTiming& search_timing = {});

  /// Takes all frames of one capture time: observe, fuse, log, then draw with what is known now.
  Status step(const std::vector<FramePtr>& frames);
  Status finish();
  /// Says where an object is, before the first step. False: it is not searched for.
  bool hint(ObjectId object, const SearchHint& hint) { return chain_->hint(object, hint); }
  /// From now on stereo points are reconstructed from every set of frames.
  void want_points(const Installation& installation);
  /// The newest of them; null: none lately.
  ScenePointsPtr points_at(Time time) const;
  const ReplaySummary& summary() const { return summary_; }
  const Rig& rig() const { return rig_; }
  /// What is known now, one track per object.
  const std::vector<PoseTrackPtr>& tracks() const { return chain_->tracks(); }
  /// The frames of the newest step, of cameras that turn with the angles as refined.
  const std::vector<FramePtr>& frames() const { return set_; }
  /// What the picture of a camera of the recording says of its angles; null: it stands still.
  const RefinerStatus* refiner(size_t camera) const;
  /// What a camera of the recording has learned to hide the objects; null: nothing.
  OcclusionDepthPtr hidden(size_t camera) const;

 private:
  struct Camera {
    CameraId id;
    std::string name;
    bool observes = false;
    std::unique_ptr<AngleRefiner> refiner;  // null: it stands still, or its picture says nothing
    std::unique_ptr<OcclusionLearner> learner;  // null: nothing is learned
    std::unique_ptr<CameraRenderer> renderer;
    std::unique_ptr<OverlayVideoWriter> video;
    std::unique_ptr<ImagePool> pool;
    size_t drawn = 0;
    size_t asked = 0, refined = 0;  // frames: by the refiner
  };

  ReplayPipeline() = default;
  Status add_camera(const Installation& installation, const RecordedCamera& recorded,
                    const ReplayOutputs& outputs);
  Status make_chain(const Installation& installation);
  /// The frames, by their refined places, into set_, and those of cameras that the installation
  /// names, under its ids, into frames_.
  void take(const std::vector<FramePtr>& frames);
  FramePtr refine(const FramePtr& frame, Camera& camera);
  Status fuse();
  void tell_verdicts(const CalibrationWatch& watch, Time now);
  void learn(const std::vector<FramePtr>& frames);
  void collect_points();
  Status draw(const std::vector<FramePtr>& frames);
  Status draw_one(const Frame& frame, Camera& camera);

  Rig rig_;
  std::vector<std::optional<Camera>> cameras_;  // by index in the recording
  std::vector<std::string> camera_names_;       // by CameraId
  std::unique_ptr<TrackingChain> chain_;
  std::vector<CameraFrame> frames_;  // of the set that is taken
  std::vector<FramePtr> set_;        // the same, by index in the recording
  std::vector<MovingBox> boxes_;
  std::vector<PoseAt> poses_;
  PoseLogWriter* log_ = nullptr;
  std::filesystem::path png_folder_;
  std::vector<CalibrationState> verdicts_;     // by CameraId, as the log has them
  std::vector<std::string> unfit_;             // by CameraId, what it was told last
  std::unique_ptr<PointCollector> collector_;  // null: no points wanted
  std::filesystem::path points_file_;
  std::vector<PointMark> marks_;
  ReplaySummary summary_;
};

}  // namespace sightline
