// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "axes/angle_worker.hpp"
#include "axes/axes_worker.hpp"
#include "heartbeat.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/base/latest_slot.hpp"
#include "sightline/base/snapshot.hpp"
#include "sightline/image/image.hpp"
#include "sightline/model/seams.hpp"
#include "sightline/observe/scene/occlusion_learner.hpp"
#include "sightline/pipeline/camera_observer.hpp"
#include "sightline/pipeline/room_watch.hpp"
#include "sightline/pipeline/track_board.hpp"
#include "sightline/render/overlay/camera_renderer.hpp"
#include "sightline/render/overlay/no_signal_slate.hpp"
#include "sightline/render/overlay/point_marks.hpp"
#include "workers/backoff.hpp"
#include "workers/fusion_worker.hpp"
#include "workers/signal_watch.hpp"
#include "workers/stream_output.hpp"

namespace sightline {

/// What the observing thread works with; a reload may exchange it between two frames.
struct ObserveStage {
  std::unique_ptr<CameraObserver> observer;
  std::unique_ptr<OcclusionLearner> learner;  ///< trained by what `observer` looks at; may be null
  std::shared_ptr<TrackBoard> board;
  std::function<void(Observation)> on_observation;  ///< must not block
  std::unique_ptr<RoomWatch> room{};                ///< null: nobody looks at the room
  std::function<void(SceneLook)> on_scene{};        ///< set if `room` is; must not block
};

/// What the drawing thread works with; a reload may exchange it between two frames.
struct DrawStage {
  std::unique_ptr<CameraRenderer> renderer;
  std::shared_ptr<TrackBoard> board;
  std::vector<NamedObject> names;  ///< of the objects, for what is told inside the stream
  /// Whether the camera stands where its calibration says; the label tells it. Must not block.
  std::function<CalibrationState()> calibration_state{};
  std::unique_ptr<NoSignalSlate> slate{};  ///< shown without signal; null: nothing is
  /// Set if the stream is to be encoded in another way than before.
  std::optional<EncoderOptions> encoder{};
  /// Reconstructed points to draw at a capture time; empty: none are shown. Must not block.
  std::function<ScenePointsPtr(Time)> points{};
  std::shared_ptr<const CalibratedCamera> calibration{};  ///< set if `points` is
};

/// What one camera's threads are made of. There is no observing thread without an observer, no
/// drawing thread without an output (roles).
struct CameraParts {
  CameraId id;
  std::string name;
  int width = 0;
  int height = 0;
  double rate_hz = 0;  ///< nominal, if the source does not know; 0: unknown
  /// May take as long as the device does; gives up where it can once it is asked to stop.
  std::function<Result<std::unique_ptr<FrameSource>>(const std::stop_token&)> open_source;
  bool reopen_when_stalled = true;  ///< a device that falls silent; false: a recording may pause
  ObserveStage observe;
  DrawStage draw;
  std::shared_ptr<StreamOutput> output;
  /// Both may be empty, and must not block: every frame as it was captured; and those that are
  /// looked at and drawn into, damaged ones too, by their refined places.
  std::function<void(const FramePtr&)> on_captured{};
  std::function<void(const FramePtr&)> on_frame{};
  std::shared_ptr<AxesWorker> head{};     ///< of a camera that turns, live; else null
  std::unique_ptr<AngleWorker> angles{};  ///< its picture refines its angles; else null
};

struct CameraStatus {
  bool present = false;  ///< the source is open, and frames come
  bool ended = false;    ///< a recording that does not loop has been played
  uint64_t frames = 0;
  double frame_age_s = -1;     ///< since the newest frame arrived; -1: none yet
  double rate_hz = 0;          ///< of the frames that come, averaged over about a second
  double capture_error_s = 0;  ///< bound on the error of the newest capture time; 0: not known
  double latency_s = 0;        ///< of the newest frame: middle of exposure to arrival
  double draw_s = 0;           ///< copying and drawing the newest frame that was shown
  uint64_t lost = 0;           ///< frames that did not reach us
  uint64_t not_observed = 0, not_drawn = 0;  ///< frames that those threads had no time for
  std::string problem;                       ///< why the source is not there
  Time lost_since{};  ///< without signal: when the last frame came, or the worker started
};

/// One camera: the threads that capture ("cap:NAME"), observe ("obs:NAME") and draw ("draw:NAME"),
/// joined by latest slots; of a camera that turns "turn:NAME" between the first and the others. A
/// source that is absent, lost or silent is opened again for ever, with back-off; meanwhile the
/// stream shows the last image, gray and stamped.
class CameraWorker {
 public:
  static std::unique_ptr<CameraWorker> start(CameraParts parts, Registry& registry,
                                             HeartbeatBoard& beats);
  ~CameraWorker() { stop(); }

  /// Works with these from the next frame on; null: goes on with what it has. The source and the
  /// stream's viewers stay.
  void exchange(std::unique_ptr<ObserveStage> observe, std::unique_ptr<DrawStage> draw);
  /// Stops capture; then the others end with what they are at. stop() waits for all.
  void request_stop();
  void stop();
  /// Same, but leaves a capture thread that waits for its device or disk once `patience` has
  /// passed. False then: this object has to outlive that thread, or the process to end.
  bool stop_unless_waiting(Duration patience);

  CameraStatus status() const;
  bool present() const;  ///< CameraStatus::present
  const std::string& name() const { return parts_.name; }
  int width() const { return parts_.width; }
  int height() const { return parts_.height; }
  bool observes() const { return observes_; }
  const std::shared_ptr<StreamOutput>& output() const { return parts_.output; }
  const std::shared_ptr<AxesWorker>& head() const { return parts_.head; }
  /// Null: its picture does not refine its angles.
  AngleWorker* angles() const { return parts_.angles.get(); }

 private:
  CameraWorker(CameraParts parts, Registry& registry);

  void capture(std::stop_token stop, Heartbeat& heartbeat);
  /// Until it is stopped or a recording ends; leaves the source open.
  void capture_from(std::unique_ptr<FrameSource>& source, std::stop_token stop,
                    Heartbeat& heartbeat);
  void deliver(const FramePtr& frame);
  /// To those that look and draw.
  void pass_on(const FramePtr& frame);
  void measure(const FrameInfo& info);
  void observe(std::stop_token stop, Heartbeat& heartbeat);
  void learn(const Frame& frame, ObserveStage& stage);
  void draw(std::stop_token stop, Heartbeat& heartbeat);
  void draw_one(const FramePtr& frame, DrawStage& stage);
  void offer_clean(const Frame& frame);
  void draw_points(const MutableI420View& image, const FrameInfo& frame, const DrawStage& stage);
  /// Takes the next stage over, if there is one.
  void renew(ObserveStage& stage);
  void renew(DrawStage& stage);
  void draw_no_signal(Time since, NoSignalSlate& slate);
  std::unique_ptr<FrameSource> open_or_wait(std::stop_token stop, Heartbeat& heartbeat,
                                            Backoff& backoff);
  /// One turn with an open source; an Error if it is of no use any more.
  Result<SourceStep> take(FrameSource& source, std::stop_token stop);
  void lose_source(std::unique_ptr<FrameSource>& source, const Error& error);
  void note_problem(const char* cause, const Error& error);
  void note_signal();

  CameraParts parts_;
  const bool observes_;
  // null where there is no such stage
  Counter* angles_dropped_ = nullptr;
  LatencyHistogram *captured_ = nullptr, *observed_ = nullptr, *drawn_ = nullptr;
  LatestSlot<FramePtr> observe_slot_, draw_slot_;
  Snapshot<const OcclusionDepth> hidden_;
  ImagePool images_;
  SignalWatch signal_;

  Registry& registry_;
  Counter &frames_, &lost_, &damaged_, &reopened_, &observe_dropped_, &draw_dropped_;
  Gauge &capture_age_, &draw_seconds_, &present_gauge_, &rate_, &capture_error_, &occluded_share_;

  mutable std::mutex mutex_;  // guards the five below
  std::unique_ptr<ObserveStage> next_observe_;
  std::unique_ptr<DrawStage> next_draw_;
  bool open_ = false, ended_ = false;
  std::string problem_;  // stays until a frame comes, so that it is said once
  std::atomic<Time> last_arrival_{};

  std::vector<PoseTrackPtr> observe_tracks_, draw_tracks_;  // scratch of their threads
  std::vector<Observation> observations_;
  std::vector<PointMark> marks_;  // scratch of the drawing thread
  AnnotatedImage annotated_;
  AnnotatedImage no_signal_;  // made once per loss
  Time no_signal_since_{};
  Time next_no_signal_{};

  WatchedThread capture_thread_, observe_thread_, draw_thread_;
};

}  // namespace sightline
