// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "sightline/fuse/estimator.hpp"
#include "support/synthetic_rig.hpp"

// An estimator over a synthetic rig, and what its estimates are worth.
namespace sightline::fuse_test {

using test::RigOptions;
using test::SyntheticRig;

inline ObjectEstimator make(const EstimatorOptions& options = {}) {
  return ObjectEstimator::create(options, ObjectId(0)).value();
}

inline RigOptions moving_rig(int cameras, uint64_t seed = 1) {
  RigOptions options;
  options.cameras = cameras;
  options.arc = 1.05 * (cameras - 1);
  options.seed = seed;
  return options;
}

struct Row {
  PoseEstimate estimate;
  UpdateReport report;
  double translation_error = 0;
  double rotation_error = 0;

  bool is(TrackState state) const { return estimate.state == state; }
};

inline std::vector<Row> run(const SyntheticRig& rig, ObjectEstimator& estimator) {
  std::vector<Row> rows;
  for (const auto& set : rig.sets()) {
    Row row;
    row.report = estimator.process(set);
    row.estimate = row.report.estimate;
    const Rigid3 truth = rig.truth(row.estimate.time);
    row.translation_error = translation_distance(row.estimate.world_from_object, truth);
    row.rotation_error = rotation_angle(row.estimate.world_from_object, truth);
    rows.push_back(row);
  }
  return rows;
}

constexpr double kWrongTranslation = 0.020;
constexpr double kWrongRotation = 10.0 / 57.29577951;

/// The promise: `tracking` is never said of a pose that is elsewhere.
inline int wrong_claims(const std::vector<Row>& rows) {
  return static_cast<int>(std::count_if(rows.begin(), rows.end(), [](const Row& row) {
    return row.is(TrackState::kTracking) &&
           (row.translation_error > kWrongTranslation || row.rotation_error > kWrongRotation);
  }));
}

inline double share_tracking(const std::vector<Row>& rows) {
  const auto n = std::count_if(rows.begin(), rows.end(),
                               [](const Row& row) { return row.is(TrackState::kTracking); });
  return static_cast<double>(n) / static_cast<double>(rows.size());
}

inline double rms_translation(const std::vector<Row>& rows, size_t from) {
  double sum = 0;
  for (size_t i = from; i < rows.size(); ++i) {
    sum += rows[i].translation_error * rows[i].translation_error;
  }
  return std::sqrt(sum / static_cast<double>(rows.size() - from));
}

inline std::vector<Fiducial> lone_tag() {
  Fiducial tag;
  tag.size = 0.05;
  return {tag};
}

}  // namespace sightline::fuse_test
