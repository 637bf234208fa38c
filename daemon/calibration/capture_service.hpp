// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "calibration/capture_session.hpp"
#include "heartbeat.hpp"
#include "sightline/base/snapshot.hpp"
#include "sightline/control/http_content.hpp"
#include "workers/frame_taps.hpp"

namespace sightline {

enum class CapturePhase : uint8_t {
  kOff,      ///< there was none since the start
  kRunning,  ///< takes views
  kSolving,  ///< takes nothing more, and solves what was taken
  kDone,     ///< there is a calibration with its report
  kFailed,   ///< there is none, and `words` say why
};

/// What a capture is at, for whoever asks.
struct CaptureShown {
  CapturePhase phase = CapturePhase::kOff;
  std::string words;  ///< what to do next, or what came of it
  std::string hint;   ///< what came of the newest image
  std::string target;
  bool moving = false, readouts = false, keep_lenses = false;
  std::filesystem::path folder;  ///< where its files are
  int64_t since_utc_ns = 0;
  CaptureGuideOptions needs;
  CaptureState state;
  std::vector<ViewedCamera> cameras;
  std::vector<CoverageCells> coverage;  ///< by camera
  std::vector<LinkReport> links;        ///< pairs of cameras that saw it together
  std::optional<CalibrationGrade> grade;
  std::vector<std::string> remarks;  ///< of the report, "left: good for 0.39 mm at 0.65 m"
};

/// Captures views of a calibration target with the cameras that run, for an operator at the page:
/// at most one at a time, on a thread ("capture") beside those that look for the target. Each has a
/// folder of its own in the state folder (captures/TIME), with what `sightline calibrate capture`
/// writes; the calibration in force is not touched. Lives as long as the process.
class CaptureService {
 public:
  CaptureService(HeartbeatBoard& beats, std::shared_ptr<FrameTaps> taps);
  ~CaptureService();

  /// True while one takes views or solves. Any thread.
  bool busy() const;
  /// Begins one; its folder. Reads and writes the disk; one thread. Refused: what cannot be chosen
  /// (capture_targets.hpp), an earlier capture of something else, no state folder.
  Result<std::filesystem::path> start(const CaptureOrder& order, const Installation& installation);
  /// No more views: what was taken is solved. Refused: there is none. Any thread, never waits.
  Status conclude();
  /// Never null. Any thread, never waits.
  std::shared_ptr<const CaptureShown> shown() const { return shown_.read(); }

  /// What was taken is on the disk; nothing is solved any more. False if a solution that is being
  /// made takes longer than that: it is left, and waited for at the end.
  bool stop(Duration patience);

 private:
  struct Run;
  void run(const std::stop_token& stop, Heartbeat& heartbeat, Run& run);
  Status watch(const std::stop_token& stop, Heartbeat& heartbeat, Run& run);
  Status finish(const std::stop_token& stop, Heartbeat& heartbeat, Run& run);
  void show(CapturePhase phase, const Run& run, const CaptureState& state);
  void wait_a_turn(const std::stop_token& stop);

  HeartbeatBoard& beats_;
  const std::shared_ptr<FrameTaps> taps_;
  Snapshot<const CaptureShown> shown_;
  std::atomic<bool> asked_to_end_{false};
  std::mutex turn_mutex_;
  std::condition_variable_any never_;
  std::mutex mutex_;  // guards the two below
  bool stopped_ = false;
  WatchedThread thread_;
};

}  // namespace sightline
