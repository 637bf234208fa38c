// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "backoff.hpp"
#include "camera_observer.hpp"
#include "fusion_unit.hpp"
#include "heartbeat.hpp"
#include "point_picture.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/base/latest_slot.hpp"
#include "sightline/image/picture.hpp"
#include "sightline/model/seams.hpp"
#include "sightline/render/camera_renderer.hpp"
#include "sightline/render/no_signal_card.hpp"
#include "signal_watch.hpp"
#include "stream_output.hpp"
#include "track_board.hpp"

namespace sightline {

/// What one camera's threads are made of. `observer`, `renderer` and `output` may be null (roles).
struct CameraParts {
  CameraId id;
  std::string name;
  int width = 0;
  int height = 0;
  double rate_hz = 0;  ///< nominal, if the source does not know; 0: unknown
  std::function<Result<std::unique_ptr<FrameSource>>()> open_source;
  bool reopen_when_stalled = true;  ///< a device that falls silent; false: a recording may pause
  std::unique_ptr<CameraObserver> observer;
  std::unique_ptr<OcclusionLearner> learner;  ///< taught by what `observer` looks at; may be null
  std::unique_ptr<CameraRenderer> renderer;
  std::unique_ptr<NoSignalCard> card;  ///< what the stream shows without signal; null: nothing
  std::shared_ptr<StreamOutput> output;
  std::shared_ptr<TrackBoard> board;
  std::function<void(Observation)> on_observation;  ///< must not block
  /// Reconstructed points to draw at a capture time; empty: none are shown. Must not block.
  std::function<ScenePointsPtr(Time)> points;
  std::shared_ptr<const CalibratedCamera> calibration;  ///< set if `points` is
  std::function<void(const FramePtr&)> on_frame;        ///< recorder; may be empty, must not block
};

struct CameraStatus {
  bool present = false;  ///< the source is open, and frames come
  bool ended = false;    ///< a recording that does not loop has been played
  uint64_t frames = 0;
  double frame_age_s = -1;     ///< since the newest frame arrived; -1: none yet
  double rate_hz = 0;          ///< of the frames that come, averaged over about a second
  double capture_error_s = 0;  ///< bound on the error of the newest capture time; 0: not known
  uint64_t lost = 0;           ///< frames that did not reach us
  std::string problem;         ///< why the source is not there
  Time lost_since{};           ///< without signal: when the last frame came, or the unit started
};

/// One camera: the threads that capture ("cap:NAME"), observe ("obs:NAME") and draw ("draw:NAME"),
/// joined by latest slots. A source that is absent, lost or silent is opened again for ever, with
/// back-off; meanwhile the stream shows the last picture, grey and stamped.
class CameraUnit {
 public:
  static std::unique_ptr<CameraUnit> start(CameraParts parts, Registry& registry,
                                           HeartbeatBoard& beats);
  ~CameraUnit() { stop(); }

  /// Draws with another renderer from the next frame on.
  void set_renderer(std::unique_ptr<CameraRenderer> renderer);
  /// Stops capture; then the others end with what they are at. stop() waits for all.
  void request_stop();
  void stop();

  CameraStatus status() const;
  const std::string& name() const { return parts_.name; }
  const std::shared_ptr<StreamOutput>& output() const { return parts_.output; }

 private:
  CameraUnit(CameraParts parts, Registry& registry);

  void capture(std::stop_token stop, Heartbeat& heartbeat);
  void deliver(const FramePtr& frame);
  void measure(const FrameInfo& info);
  void observe(std::stop_token stop, Heartbeat& heartbeat);
  void learn(const Frame& frame);
  void draw(std::stop_token stop, Heartbeat& heartbeat);
  void draw_one(const FramePtr& frame, CameraRenderer& renderer);
  void draw_no_signal(Time since);
  std::unique_ptr<FrameSource> open_or_wait(std::stop_token stop, Heartbeat& heartbeat,
                                            Backoff& backoff);
  /// One turn with an open source; an Error if it is of no use any more.
  Result<SourceStep> take(FrameSource& source, std::stop_token stop);
  void lose_source(std::unique_ptr<FrameSource>& source, const Error& error);
  void note_problem(const char* cause, const Error& error);
  void note_signal();

  CameraParts parts_;
  LatestSlot<FramePtr> observe_slot_, draw_slot_;
  HiddenDepthSlot hidden_;
  PicturePool pictures_;
  SignalWatch signal_;

  Registry& registry_;
  Counter &frames_, &lost_, &damaged_, &reopened_, &observe_dropped_, &draw_dropped_;
  Gauge &capture_age_, &draw_seconds_, &present_gauge_, &rate_, &capture_error_, &hidden_share_;

  mutable std::mutex mutex_;  // guards the four below
  std::unique_ptr<CameraRenderer> next_renderer_;
  bool open_ = false, ended_ = false;
  std::string problem_;  // stays until a frame comes, so that it is said once
  std::atomic<Time> last_arrival_{};

  std::vector<PoseTrackPtr> observe_tracks_, draw_tracks_;  // scratch of their threads
  std::vector<Observation> observations_;
  std::vector<PointMark> marks_;  // scratch of the drawing thread
  AnnotatedPicture annotated_;
  AnnotatedPicture no_signal_;  // made once per loss
  Time no_signal_since_{};
  Time next_no_signal_{};

  std::jthread capture_thread_, observe_thread_, draw_thread_;
};

}  // namespace sightline
