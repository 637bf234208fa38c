// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "sightline/base/ids.hpp"
#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/model/observation.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/model/shape_symmetry.hpp"

namespace sightline {

/// How one object is estimated. Defaults suit things moved by hand or by a robot (about 1 m/s and
/// 200 deg/s) seen at 5 to 120 frames per second; docs/estimator.md says why.
struct EstimatorOptions {
  MotionNoise noise;         ///< nominal: of the liveliest usual motion
  bool adapt_motion = true;  ///< learn from the innovations how calm the motion is

  double gate_probability = 0.999;  ///< a right measurement passes the chi-square gate so often
  double min_quality = 0.05;        ///< a camera below it says nothing (PoseTerm quality)
  double max_normalized_cost = 36;  ///< chi-square per residual beyond which a camera is refused
  int max_iterations = 8;           ///< of one update

  /// One sigma of what a camera may at worst be off in every frame, by its calibration and stamps
  /// [m, rad]: a disagreement that this explains widens the camera's covariance, and is learned; a
  /// larger one is a wrong measurement.
  double systematic_translation = 0.006;
  double systematic_rotation = 0.02;
  bool learn_systematic = true;  ///< from the disagreement of the cameras

  Duration ring = std::chrono::milliseconds(300);      ///< how late a set may come
  Duration history = std::chrono::milliseconds(1000);  ///< length of the published track
  int ring_capacity = 256;                             ///< sets; bounds memory and replay time

  double max_sigma_translation = 0.010;  ///< [m] weakest direction for `tracking`
  /// The same when one camera alone holds the object: nobody contradicts a wrong minimum there.
  double max_sigma_translation_alone = 0.005;
  double max_sigma_rotation = 0.0436;  ///< [rad] (2.5 deg) weakest direction for `tracking`
  /// The same (1.25 deg) when outline and edges in one camera alone hold the object: a tilt changes
  /// its outline little, and one that is lost leaves it well explained.
  double max_sigma_rotation_alone = 0.0218;
  bool one_camera_is_degraded = false;  ///< else one camera is judged by its covariance
  bool flat_print_is_degraded = true;   ///< see kFlatPrint; else it counts like any print
  int confirm_sets = 2;                 ///< consistent sets of one camera before `tracking`
  int reset_sets = 3;                   ///< consistent contradicting sets before a reset
  int max_hypotheses = 4;               ///< poses followed at the same time, 1..4
  double drop_margin = 16.0;            ///< evidence (-2 log likelihood) that ends a hypothesis
  double start_sigma_linear = 1.0;      ///< [m/s] velocity of a found object, about zero
  double start_sigma_angular = 3.5;     ///< [rad/s]
  double reacquire_sigma_translation = 0.1;  ///< [m] a prediction looser than this proves nothing:
  double reacquire_sigma_rotation = 0.35;    ///< [rad] starts are tried again and confirmed again

  /// A camera that saw the object in its newest frame holds it for this many of its frame periods.
  double hold_periods = 1.5;
  Duration max_hold = std::chrono::milliseconds(250);
  /// advance(): silence on top of that before `coasting`; covers detection time and transport.
  Duration silence = PoseTrack::kFreshFor;
  Duration lost_after = PoseTrack::kCoastLimit;         ///< after the last accepted measurement
  Duration searching_after = std::chrono::seconds(10);  ///< after it, `lost` becomes `searching`

  bool operator==(const EstimatorOptions&) const = default;
};

/// What one set of observations came to.
struct UpdateReport {
  /// At the set's capture time, newer sets not counted; poses.csv has a row of it. Pose, twist and
  /// covariance mean something if has_pose(estimate.state).
  PoseEstimate estimate;
  CameraSet accepted = 0;  ///< cameras whose measurement took part
  CameraSet gated = 0;     ///< cameras that contradict the rest and were refused
  int hypotheses = 0;      ///< poses still possible
  int iterations = 0;      ///< of the update (best hypothesis)
  double residual = 0;     ///< root mean square of the accepted [standard deviations]
  bool late = false;       ///< inserted before sets that were processed already
  bool dropped = false;    ///< too late or a duplicate; nothing changed
  bool reset = false;      ///< the estimate jumped to a pose that the cameras agree on
};

/// Totals since create().
struct EstimatorCounters {
  uint64_t sets = 0;
  uint64_t accepted = 0;  ///< camera measurements
  uint64_t gated = 0;     ///< camera measurements
  uint64_t late_inserted = 0;
  uint64_t late_dropped = 0;
  uint64_t duplicates = 0;
  uint64_t starts = 0;  ///< from searching or lost
  uint64_t resets = 0;
};

/// Where one object is: an error-state Kalman filter on SE(3) with body twist (12 states), iterated
/// over the PoseTerms of any number of cameras, each at its own capture time. Equations:
/// docs/estimator.md. Passive: no threads, no clock; same calls, same bytes. Not thread-safe; the
/// snapshots it returns are.
class ObjectEstimator {
 public:
  /// Refuses options that are out of range, naming them. `shape_symmetry`: poses that the object's
  /// shape cannot tell apart; while nothing else tells them apart the state is `degraded`.
  static Result<ObjectEstimator> create(const EstimatorOptions& options, ObjectId object,
                                        const ShapeSymmetry& shape_symmetry = {});
  ~ObjectEstimator();
  ObjectEstimator(ObjectEstimator&&) noexcept;
  ObjectEstimator& operator=(ObjectEstimator&&) noexcept;

  /// Takes observations that share one capture time (one camera, or several that expose together);
  /// they enter one joint update. Sets may come out of order: one that is older than the newest is
  /// put where it belongs and the later ones are replayed, with the result of in-order delivery.
  /// A further set of the same capture time joins the earlier one; of two of one camera the
  /// first counts, unless only the second (a slower one) saw the object. Observations of other
  /// objects are ignored. An observation without terms means "searched and not seen": always
  /// pass it.
  UpdateReport process(std::span<const Observation> set);

  /// Tells the estimator the time [CLOCK_MONOTONIC, now] so that silence of all cameras becomes
  /// `coasting` and `lost`. Never influences what process() computes.
  void advance(Time now);

  /// Goes on with what somebody else has estimated: everything known here is forgotten, the newest
  /// estimate of `track` is what is known at its time, with its covariance; older ones are shown.
  /// What was captured before that is too late from then on, as it is in the estimate already.
  /// Nothing changes (false) if the newest estimate has no pose.
  bool adopt(const PoseTrack& track);

  /// Whether another orientation is suspected to explain the images better than the one in force:
  /// until it is said no more, the object is not `tracking`. Counts for sets processed from now on.
  void set_doubted(bool doubted);

  /// Whether this may be another object that looks alike: `degraded` (kPossibleSwap) until it is
  /// said no more. Counts for sets processed from now on.
  void set_possible_swap(bool possible);

  /// Snapshot with about `history` of estimates; never null. Cheap if nothing changed since.
  PoseTrackPtr track() const;
  /// State now: of the newest set, or of advance().
  TrackState state() const;
  const EstimatorCounters& counters() const;
  const EstimatorOptions& options() const;

 private:
  struct Impl;
  explicit ObjectEstimator(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
