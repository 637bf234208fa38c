// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "conditions.hpp"
#include "sightline/base/result.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline::bench {

/// What was known after one set of frames, beside the truth.
struct Sample {
  Time time{};
  TrackState state = TrackState::kSearching;
  bool started = false;                 ///< this set was given the true pose
  bool failed = false;                  ///< no pose, or off by more than 5 cm or 5 deg
  double visible = 1;                   ///< largest share of the object that a camera sees now
  double mm = 0, deg = 0;               ///< error; meaningful if has_pose(state)
  double lateral_mm = 0, depth_mm = 0;  ///< across and along the first camera's axis
  double nees = 0;  ///< of the pose, six degrees of freedom (five if symmetric about an axis)
};

struct Played {
  std::vector<Sample> samples;
  std::vector<double> step_ms;  ///< CPU of one camera's frame: everything that observes
  std::vector<double> fuse_ms;  ///< CPU of one set
  double detect_ms = 0;         ///< CPU of one search, mean
  std::vector<double> find_ms;  ///< CPU of each search that found something
  size_t searches = 0;
  size_t faces = 0;
};

struct PlayOptions {
  std::filesystem::path shots;   ///< folder of rendered images; empty: rendered every time
  std::filesystem::path sheets;  ///< folder of contact sheets and plots; empty: none
  bool silhouettes = true;       ///< detect.silhouettes
};

/// One sequence through what replay runs: each camera's observer with the track known so far, then
/// the estimator; nothing but the start of held sequences comes from the truth.
Result<Played> play(const Condition& condition, uint64_t seed, const PlayOptions& options);

}  // namespace sightline::bench
