// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/model/observation.hpp"
#include "sightline/observe/detect/object_detector.hpp"
#include "sightline/pipeline/camera_observer.hpp"
#include "sightline/pipeline/rig.hpp"
#include "sightline/record/evaluate.hpp"
#include "sightline/record/recording.hpp"

namespace sightline::cli {

/// Which sets of frames of a recording are searched, and for what.
struct SetSearchOptions {
  std::filesystem::path recording;
  std::vector<std::string> cameras;   ///< that take part; empty: all
  std::string object;                 ///< name; empty: each
  std::filesystem::path object_file;  ///< look for this one, which is not there; empty: its own
  size_t every = 10;                  ///< every so many sets; key frames: each
  size_t limit = SIZE_MAX;
  bool moving = false;  ///< where something has moved since the set that was searched before
  bool explain = false;
};

enum class Verdict {
  kNothing,
  kRight,          ///< the one pose, up to the symmetries of the shape
  kAmong,          ///< right among several hypotheses
  kWrong,          ///< the right one is not among them, or the object is not there
  kNotComparable,  ///< found, but the recording does not say where it is
};
std::string_view to_string(Verdict verdict);

/// What the trackers of the cameras say of a pose: lines of the outline that agree, of how many.
struct TrackerView {
  std::string camera;
  int lines_used = 0, lines_total = 0, edges_used = 0, points_used = 0;
  bool seen = false;
};

/// A pose, stage by stage.
struct ExplainedPose {
  PoseAssessment stages;
  double colors = 0;  ///< of the mesh with the images, correlation; 0 without colors
  std::vector<TrackerView> trackers;
};

/// What became of the truth in the search by contours.
struct Explanation {
  DetectionTrace trace;
  std::vector<std::optional<size_t>> ranks;  ///< of the first right pose after each stage
  std::optional<Rigid3> best;                ///< that the search ends with, believed or not
  bool best_is_right = false;
  bool best_is_near_turn = false;          ///< right up to turns that the shape hardly tells
  double best_score = 0, rival_score = 0;  ///< rival: the best at another place
  std::optional<ExplainedPose> at_truth, at_best;
};

/// One set of frames, the newest of every camera, searched by itself: no background, no memory but
/// of the set before, if what moves is looked for.
struct SetResult {
  Time time{};  ///< of the newest frame
  std::optional<Rigid3> truth;
  std::vector<PoseHypothesis> found;
  Verdict verdict = Verdict::kNothing;
  double cpu_ms = 0, wall_ms = 0;
  std::optional<Explanation> explanation;
};

/// One object of a recording.
struct SearchedObject {
  std::string name;
  const Installation* installation = nullptr;  ///< with this object and the cameras that take part
  const Rig* rig = nullptr;
};

/// Searches sets of frames for one object after the other; `on_set` gets each result with its
/// frames (by camera). Refused: what open_recording(), recording_installation() and load_rig()
/// refuse, an unknown name of a camera or object.
using OnSet =
    std::function<void(const SearchedObject&, const SetResult&, const std::vector<FramePtr>&)>;
Status search_sets(const SetSearchOptions& options, const OnSet& on_set);

}  // namespace sightline::cli
