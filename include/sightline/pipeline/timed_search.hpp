// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "sightline/pipeline/carry_forward.hpp"
#include "sightline/pipeline/frame_trail.hpp"
#include "sightline/pipeline/object_search.hpp"

namespace sightline {

/// A frame, and which camera of the installation it is of: the frame itself may carry another id,
/// that of its recording.
struct CameraFrame {
  CameraId camera;
  FramePtr frame;
};

/// When the results of a search enter, where nothing runs beside it.
struct SearchTiming {
  bool instant = false;    ///< at once, as if searching took no time
  double cost_factor = 1;  ///< else when search_cost() times this has passed
};

/// A search on the clock of a recording, as the daemon's thread "find" would do it there: what it
/// finds is known when its work would have been done, and has been carried through the frames that
/// came meanwhile. Passive; reads no clock; the same calls give the same results.
class TimedSearch {
 public:
  /// `search` must outlive this. `cameras`: of the installation.
  TimedSearch(ObjectSearch& search, size_t cameras, double cost_factor);

  /// Lets the time pass to `now`, of which no frame has been given yet. Returns what a search that
  /// ended before has come to; empty: none ended, or it found nothing.
  std::vector<Observation> advance(Time now, std::span<const PoseTrackPtr> tracks);
  /// Takes frames of one capture time, after advance() to it. Begins a search with the newest of
  /// each camera if one is due and none is under way; false: it was not.
  bool take(std::span<const CameraFrame> frames, std::span<const PoseTrackPtr> tracks);

  /// Whether a search has begun whose results are not known yet, or not checked.
  bool under_way() const { return under_way_.has_value(); }
  /// All that has been charged so far.
  Duration charged() const { return charged_; }

 private:
  /// One step of what is under way; false: that is done.
  bool step(std::span<const PoseTrackPtr> tracks, std::vector<Observation>& found);
  /// Charges what has been done since it was charged last.
  void charge();

  ObjectSearch& search_;
  const double cost_factor_;
  FrameTrail trail_;              ///< since the search under way began
  std::vector<FramePtr> newest_;  ///< by CameraId; not yet given to the search
  std::optional<CarryForward> under_way_;
  bool handed_ = false;   ///< what it has found is to be checked
  bool checked_ = false;  ///< it has been, which took until `done_`
  Time began_{};          ///< the search under way
  Time done_{};           ///< what it has done so far
  SearchWork counted_;
  Duration charged_{};
};

}  // namespace sightline
