// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "calibration/target_frames.hpp"
#include "sightline/base/time.hpp"
#include "sightline/model/seams.hpp"
#include "sightline/observe/fiducial/target_detector.hpp"

namespace sightline {

/// What one camera is at, for a person.
struct TargetCameraStatus {
  bool open = false, ended = false;  ///< its source; a recording that has been played
  uint64_t frames = 0, looked_at = 0, seen = 0;
  std::string problem;  ///< why there are no images, or why no target is found in them
};

/// One camera while it is calibrated: a thread that takes its images ("cap:NAME") and one that
/// looks for the target in the newest of them ("find:NAME"). A source that is lost is opened again.
/// Where frames come from somebody who has the camera already, there is the second thread alone.
class TargetCamera {
 public:
  struct Parts {
    std::string name;
    CalibrationTarget target;
    std::unique_ptr<TargetDetector> detector;
    /// Empty: frames come by `frames`.
    std::function<Result<std::unique_ptr<FrameSource>>(const std::stop_token&)> open_source;
    /// On the thread that looks; corners in order of their ids, empty where there is no target.
    std::function<void(const Frame& frame, const std::vector<DetectedCorner>& corners)> on_image;
    std::shared_ptr<TargetSlot> frames = std::make_shared<TargetSlot>();
    int nice = 0;  ///< see give_way(); of the thread that looks
  };
  static std::unique_ptr<TargetCamera> start(Parts parts);
  ~TargetCamera() { stop(); }

  void request_stop();
  void stop();
  TargetCameraStatus status() const;
  CharucoLayout layout() const;  ///< of the print, once the images say it

 private:
  explicit TargetCamera(Parts parts) : parts_(std::move(parts)) {}
  void capture(const std::stop_token& stop);
  void find(const std::stop_token& stop);
  void explain(const Frame& frame);
  void note_problem(const std::string& problem);
  void fail(const std::string& what);  ///< a thread of it has ended

  Parts parts_;
  mutable std::mutex mutex_;  // guards the two below
  TargetCameraStatus status_;
  CharucoLayout layout_ = CharucoLayout::kAny;
  std::jthread capture_thread_, find_thread_;
};

}  // namespace sightline
