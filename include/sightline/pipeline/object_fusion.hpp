// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sightline/calibrate/calibration_watch.hpp"
#include "sightline/fuse/estimator.hpp"
#include "sightline/fuse/swap_watch.hpp"
#include "sightline/model/stream_types.hpp"
#include "sightline/pipeline/track_board.hpp"

namespace sightline {

/// Where observations become tracks: the estimators of all objects, and the board on which they
/// publish. Live on the fusion thread, in replay between two sets of frames. One thread at a time;
/// no clock of its own.
class ObjectFusion {
 public:
  /// `objects` and `shape_symmetry` by ObjectId; a missing symmetry is none. `board` and `watch`
  /// may be null.
  static Result<std::unique_ptr<ObjectFusion>> create(
      const EstimatorOptions& options, std::span<const NamedObject> objects,
      std::span<const ShapeSymmetry> shape_symmetry, std::shared_ptr<TrackBoard> board = nullptr,
      std::unique_ptr<CalibrationWatch> watch = nullptr);

  /// From now on objects of one kind that may have been swapped are `degraded`. By ObjectId.
  void watch_swaps(const std::vector<AlikeObject>& objects) { swaps_.emplace(objects); }

  /// Takes observations that share one capture time, of any cameras and objects: one joint update
  /// of each object that is among them, and a report of each, in order of ObjectId. Valid until the
  /// next call.
  std::span<const UpdateReport> process(std::span<const Observation> set);

  /// Tells the estimators the time, so that silence shows (ObjectEstimator::advance()). Returns the
  /// objects whose state it changed; valid until the next call.
  std::span<const ObjectId> advance(Time now);

  /// See ObjectEstimator::set_doubted().
  void set_doubted(ObjectId object, bool doubted);
  /// What the cameras' places are believed to be; null: nobody watches.
  CalibrationWatch* watch() { return watch_.get(); }
  const CalibrationWatch* watch() const { return watch_.get(); }
  /// Whether process() brought a new verdict on a camera.
  bool has_verdict() const { return verdict_; }

  /// Drops what is known of an object: it is searching, as if it had never been seen.
  void forget(ObjectId object);

  /// ObjectEstimator::adopt(), where the object has no pose here; true: it has now.
  bool adopt(const PoseTrack& track);

  /// One per object, never null.
  const std::vector<PoseTrackPtr>& tracks() const { return tracks_; }
  const ObjectEstimator& estimator(ObjectId object) const { return estimators_[object.index()]; }

 private:
  ObjectFusion() = default;
  void publish(size_t object);
  void look_for_swaps();
  /// A camera that turns is not watched: what is not known of its place comes with its frames.
  bool turns(const Observation& observation) const;
  std::span<const Observation> with_calibration_covariance(std::span<const Observation> set);

  EstimatorOptions options_;
  std::vector<ShapeSymmetry> shape_symmetry_;  // by ObjectId
  std::vector<ObjectEstimator> estimators_;    // by ObjectId
  std::vector<PoseTrackPtr> tracks_;           // by ObjectId
  std::shared_ptr<TrackBoard> board_;          // null: nobody reads
  std::unique_ptr<CalibrationWatch> watch_;    // null: nobody watches
  std::optional<SwapWatch> swaps_;
  bool verdict_ = false;
  std::vector<Observation> widened_;  // scratch
  std::vector<UpdateReport> reports_;
  std::vector<ObjectId> changed_;
};

}  // namespace sightline
