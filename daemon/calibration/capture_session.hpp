// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "calibration/target_camera.hpp"
#include "calibration/target_frames.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/calibrate/capture_guide.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/pipeline/source_factory.hpp"

namespace sightline {

/// Views, and the calibration that was made of them.
struct SolvedCapture {
  CalibrationViews views;
  SolvedRig rig;
};

struct CaptureSessionOptions {
  CalibrationTarget target;
  int window = 0;      ///< see TargetDetectorOptions
  SolveOptions solve;  ///< `cameras` as many as take part, or none
  CaptureGuideOptions guide;
  std::optional<CalibrationViews> earlier;  ///< to go on with
  /// Frames come from cameras that run already, by CaptureSession::frames(); no source is opened,
  /// and all that live is goes first.
  bool live = false;
};

/// What a capture is at, for a person or a page.
struct CaptureState {
  size_t sets = 0;
  double share = 0;
  CaptureAdvice advice;
  CaptureStep step;  ///< what came of the newest image
  std::vector<CameraProgress> progress;
  std::vector<TargetCameraStatus> cameras;
  bool passed = false;
  bool ended = false;                  ///< all cameras are recordings that have been played
  std::optional<Error> error;          ///< what was seen can never be solved; nothing more is taken
  std::optional<std::string> refusal;  ///< why there is no solution yet, if nothing else is missing
  bool concluded = false;              ///< conclude() is done
};

/// Cameras that watch for a target, the guide that takes views, and a solver beside them
/// ("solve"), which begins anew whenever there is enough that is new. Any thread may ask.
class CaptureSession {
 public:
  /// Cameras by their index in the installation. Refused: a target that cannot be looked for, an
  /// earlier capture of something else.
  static Result<std::unique_ptr<CaptureSession>> start(const Installation& installation,
                                                       const std::vector<size_t>& cameras,
                                                       const CaptureSessionOptions& options);
  ~CaptureSession() { stop(); }

  CaptureState state() const;
  CalibrationViews views() const;
  std::vector<ViewedCamera> cameras() const;
  std::string coverage_svg(size_t camera) const;
  CoverageCells coverage(size_t camera) const;
  std::string page(bool over) const;
  size_t links(size_t a, size_t b) const;  ///< sets in which both cameras saw it
  /// Of the newest solution, whether it passes or not.
  std::shared_ptr<const SolvedCapture> solved() const;

  /// Of a live session.
  const std::shared_ptr<const TargetFrames>& frames() const { return frames_; }

  /// Takes nothing more, and has all that was taken solved, if it is not; CaptureState::concluded
  /// tells when. Never waits.
  void conclude();
  /// Asks all threads to end, without waiting.
  void request_stop();
  /// Ends all threads; a solution that is being made is waited for.
  void stop();

 private:
  CaptureSession(const CaptureSessionOptions& options, std::vector<ViewedCamera> cameras);
  void see(size_t camera, const Frame& frame, const std::vector<DetectedCorner>& corners);
  std::vector<TargetCamera::Parts> parts_of(const Installation& installation,
                                            const std::vector<size_t>& cameras,
                                            std::vector<std::unique_ptr<TargetDetector>> detectors);
  Status check_layout(size_t camera) const;
  void solve(const std::stop_token& stop);
  /// Whether to solve now; `mutex_` is held.
  bool worth_solving() const;

  const CaptureSessionOptions options_;
  Registry registry_;
  SourceFactory sources_{registry_};
  mutable std::mutex mutex_;  // guards all below but the threads
  std::condition_variable_any taken_;
  CaptureGuide guide_;
  CaptureStep step_;
  std::optional<Error> error_;
  std::optional<std::string> refusal_;
  bool concluding_ = false, concluded_ = false;
  size_t tried_sets_ = 0;  // of the newest solution, or try
  std::shared_ptr<const SolvedCapture> solved_;
  std::vector<Duration> offsets_;  // by camera, that are in the frames' capture times already
  std::shared_ptr<const TargetFrames> frames_;
  std::vector<std::unique_ptr<TargetCamera>> cameras_;
  std::jthread solver_;
};

}  // namespace sightline
