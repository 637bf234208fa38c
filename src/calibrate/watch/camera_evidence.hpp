// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <vector>

#include "calibrate/watch/look_rounds.hpp"
#include "sightline/calibrate/calibration_watch.hpp"

namespace sightline::calibrate {

/// A correction of a camera's place and how well it is known.
struct CorrectionFit {
  Vector6 correction = Vector6::Zero();
  Matrix6 covariance = Matrix6::Zero();
  double significance = 0;  ///< squared distance from no correction, floor included
  double gain = 0;          ///< -2 log likelihood ratio of a correction against none
};

/// How the corrections went over time.
struct CourseFit {
  bool ramp = false;  ///< a steady drift explains it better than a step
  double gain = 0;
  size_t from = 0;                 ///< bucket with which it began
  CorrectionFit now;               ///< the correction today
  Vector6 rate = Vector6::Zero();  ///< of a ramp [1/s]
};

/// What was learned of one camera's place, in sums over a few seconds: a ring of fine ones, before
/// it one of coarse ones. Preallocated.
class CameraEvidence {
 public:
  explicit CameraEvidence(const CalibrationWatchOptions& options);

  /// One round; `world_from_object`: where the object was.
  void add(Time time, const Correction& correction, const Rigid3& world_from_object);
  /// Ends the sum that is being made. False: there was none.
  bool close();
  /// Drops what was learned since `time`, or all but the newest `keep` buckets.
  void forget_since(Time time);
  void forget_before(size_t keep);
  void forget_until(Time time);  ///< what was learned before it
  void clear();

  size_t size() const { return count_; }
  Time begin(size_t bucket) const { return at(bucket).begin; }
  int64_t rounds() const { return rounds_; }
  /// Variance factor: how much larger the scatter from bucket to bucket is than the looks claim.
  double scale() const;
  /// Mean information of one round.
  Matrix6 round_information() const;

  /// A constant correction in the newest `buckets`.
  CorrectionFit fit_newest(size_t buckets) const;
  /// The step or ramp, from any bucket on, that explains all of it best.
  CourseFit fit_course() const;

 private:
  struct Bucket {
    Time begin{};
    Correction sum;
    int rounds = 0;
    int places = 0;  ///< at which the object was seen for the first time since it moved
  };
  struct Scatter {
    double sum = 0, weight = 0;
    double value() const;
  };

  Bucket& at(size_t i) { return buckets_[(first_ + i) % buckets_.size()]; }
  const Bucket& at(size_t i) const { return buckets_[(first_ + i) % buckets_.size()]; }
  void make_room();
  void note_scatter(size_t lag, Scatter& scatter);
  CorrectionFit finish(const Correction& sum, int rounds, int places) const;

  CalibrationWatchOptions options_;
  std::vector<Bucket> buckets_;  // a ring: coarse ones first
  size_t first_ = 0, count_ = 0, coarse_ = 0;
  Bucket open_;
  int64_t rounds_ = 0;
  Scatter near_, far_;
  Rigid3 place_;
  bool placed_ = false;
  Matrix6 prior_;
  Matrix6 floor_;
};

}  // namespace sightline::calibrate
