// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sightline/model/object.hpp"
#include "sightline/record/pose_log.hpp"

namespace sightline {

/// Rotations that leave an object's look as it is; rotation errors are the least over them.
struct SymmetryOption {
  Symmetry kind = Symmetry::kNone;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  ///< object frame
  int order = 1;                                    ///< for kDiscrete
};

/// What of an object's mesh its errors refer to.
struct EvaluatedShape {
  /// Whose distance is the translation error, object frame [m]; of poses that differ by a symmetry
  /// only the middle of the shape is in the same place.
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  /// Rotations of the shape onto itself (ViewpointModel::symmetry_rotations()).
  std::vector<Rigid3> symmetries;
};

struct EvaluateOptions {
  double wrong_translation_mm = 20;  ///< a `tracking` row further off is a wrong claim
  double wrong_rotation_deg = 10;
  double success_translation_mm = 50;
  double success_rotation_deg = 5;
  /// Rows between two truth times further apart than this count as outside the truth.
  Duration max_truth_gap = std::chrono::milliseconds(200);
  /// A truth time is covered by a row with a pose so close to it.
  Duration coverage_tolerance = std::chrono::milliseconds(1);
  /// The truth holds at its own times only, and each of them is judged: one without a row in the
  /// log is a failure.
  bool keyframes = false;
  std::map<std::string, SymmetryOption> symmetry;  ///< by object name
  std::map<std::string, EvaluatedShape> shape;     ///< by object name; absent: origin, no symmetry
  /// Names of objects that look the same, kMostAlike at most in a group. No image says which is
  /// which at first, so the names of the log are given to them as most of all rows are within the
  /// success limits: once, so that a swap later on is an error.
  std::vector<std::vector<std::string>> alike;
  static constexpr size_t kMostAlike = 8;
};

/// Median, 95th percentile (nearest rank) and maximum of `count` errors; 0 if there are none.
struct ErrorSummary {
  size_t count = 0;
  double median_mm = 0, p95_mm = 0, max_mm = 0;
  double median_deg = 0, p95_deg = 0, max_deg = 0;
};

/// Squared errors over what the log claims. A row's sigmas are those of the worst direction: where
/// they are honest, the mean over three directions is between 1 and 3, and 5 % of the rows at most
/// are `beyond` 2.8 sigma.
struct NormalizedError {
  size_t count = 0;
  double translation = 0, rotation = 0;  ///< means of (error / sigma)^2
  double beyond = 0;                     ///< share of rows, translation or rotation
};

/// Errors against that of the poses with the true shape that is nearest in rotation.
struct ShapeErrors {
  ErrorSummary all;
  size_t within = 0;        ///< the success limits
  size_t wrong_claims = 0;  ///< `tracking` rows beyond the limits
};

/// How far the logged poses of one object are from the truth.
struct ObjectEvaluation {
  std::string object;
  std::string logged_as;     ///< its name in the log: another one only of EvaluateOptions::alike
  size_t rows = 0;           ///< of the log
  size_t outside_truth = 0;  ///< rows with a pose, before, after or in a gap of the truth
  ErrorSummary all;          ///< rows with a pose, whatever the state
  std::map<TrackState, ErrorSummary> by_state;
  std::array<size_t, 5> state_rows{};  ///< rows per TrackState
  std::vector<Time> wrong_claims;      ///< `tracking` but further off than the limits
  std::map<TrackState, NormalizedError> normalized;
  size_t judged = 0;  ///< rows of any state at times that have truth ...
  size_t within = 0;  ///< ... and those of them with a pose within the success limits
  std::optional<ShapeErrors> up_to_symmetry;  ///< if its shape is known and has any
  size_t truth_times = 0;
  size_t covered = 0;  ///< truth times with a pose
  double coverage() const;
  double success() const;  ///< within / judged: rows without a pose are failures, seen or not
};

struct Evaluation {
  bool keyframes = false;
  std::vector<ObjectEvaluation> objects;   ///< every object of the truth, by name
  std::vector<std::string> without_truth;  ///< logged objects that have no truth
};

/// The truth of one object at `time`, on the geodesic of SE(3) between its neighbors; nothing
/// before, after and between rows further apart than `max_gap`. Rows by time.
std::optional<Rigid3> truth_at(std::span<const TruthRow> truth, Time time, Duration max_gap);

/// Compares poses with the truth, interpolated on SE(3) between its times and never beyond.
Evaluation evaluate(std::span<const TruthRow> truth, std::span<const PoseLogRow> poses,
                    const EvaluateOptions& options = {});

/// Translation [mm] and rotation [deg] between a pose and the truth.
struct PoseError {
  double mm = 0, deg = 0;
};
PoseError pose_error(const Rigid3& truth, const Rigid3& pose, const SymmetryOption& symmetry = {},
                     const EvaluatedShape& shape = {});

/// Of the true poses that look alike, the one that is nearest to `pose` in rotation.
Rigid3 nearest_symmetric(const Rigid3& truth, const Rigid3& pose, const SymmetryOption& symmetry);

/// A table for people, and the same as JSON.
std::string to_text(const Evaluation& evaluation);
std::string to_json(const Evaluation& evaluation);

}  // namespace sightline
