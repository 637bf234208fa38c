// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "sightline/model/observation.hpp"
#include "sightline/pipeline/frame_trail.hpp"

namespace sightline {

struct CarryOptions {
  /// The first step: nobody knows yet how the object moves.
  Duration first_step = std::chrono::milliseconds(40);
  /// Those that follow. Longer ones catch up sooner and lose what is fast.
  Duration step = std::chrono::milliseconds(120);
  /// And at most, where now is far. Those that take nearly so long are longer still: they would
  /// never reach it otherwise.
  Duration max_step = std::chrono::milliseconds(240);
  /// Steps in a row that may find nothing: the object is covered or blurred for a moment.
  int max_misses = 2;
  /// So far behind the newest frame the trackers take over.
  Duration close_enough = std::chrono::milliseconds(60);
  /// What was found on the way so long before the end is handed over, too: it says how the object
  /// moves. Less than EstimatorOptions::ring.
  Duration way = std::chrono::milliseconds(230);
};

/// Follows what was found into these frames, one of a camera at most; empty: it is not there.
using FollowStep = std::function<std::vector<Observation>(std::span<const FramePtr> frames)>;

/// The search that found it began at most so long ago: then its result is given up.
constexpr Duration kMaxCarry = std::chrono::seconds(5);

/// Carries what a search has found, some tenths of a second ago, through the frames that came
/// meanwhile to now: the object is followed from step to step, because in the newest frame it may
/// be anywhere. Ends when a step has seen the newest frame that there was when it began (another
/// step would end as late behind), when nothing is found any more (then the result is empty), or
/// when `go_on` says no. Returns where it was at last and on the way there, by time of capture.
std::vector<Observation> carry_forward(FrameTrail& trail, std::vector<Observation> found,
                                       const FollowStep& follow, const std::function<bool()>& go_on,
                                       const CarryOptions& options = {});

/// The same step by step, for those whose clock stands still during a step. One thread at a time.
class CarryForward {
 public:
  explicit CarryForward(std::vector<Observation> found, const CarryOptions& options = {});
  /// One call of `follow`; false: the trail has no frame to go on to, or all is lost.
  bool step(FrameTrail& trail, const FollowStep& follow);
  /// Where it came to, and on which way; empty: it was not there any more.
  std::vector<Observation> take();

 private:
  Duration next_step(Time newest) const;

  const CarryOptions options_;
  std::vector<Observation> found_;  ///< of all steps, the newest last
  Time now_{};
  int misses_ = 0;
  std::optional<Time> stepped_;  ///< newest frame when the last step began
  bool caught_up_ = false;       ///< that one has seen it
};

}  // namespace sightline
