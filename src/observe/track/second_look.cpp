// SPDX-License-Identifier: Apache-2.0
#include "observe/track/second_look.hpp"

#include <Eigen/Cholesky>
#include <algorithm>

namespace sightline::observe {
namespace {

constexpr double kUnexpected = 12.6;  // 95 % of chi-square with 6 dof
constexpr double kMovedRadii = 0.1;   // of the object: less is within reach of a fit
constexpr Duration kRecent = std::chrono::milliseconds(100);

}  // namespace

std::optional<Prediction> where_it_was(const PoseEstimate& newest, Time time, double radius,
                                       bool ambiguous) {
  const Duration since = time - newest.time;
  if (since <= Duration(0) || since > kRecent || !has_pose(newest.state)) return std::nullopt;
  const Vector6 moved = to_seconds(since) * newest.twist;
  const double turn = moved.head<3>().norm(), shift = moved.tail<3>().norm();
  if (shift + radius * turn < kMovedRadii * radius) return std::nullopt;
  Prediction out{newest.world_from_object, newest.own_covariance(), ambiguous};
  out.covariance.diagonal().head<3>().array() += turn * turn / 3;
  out.covariance.diagonal().tail<3>().array() += shift * shift / 3;
  return out;
}

bool calls_for_second_look(const Prediction& prediction,
                           const ModelTracker::Measurement& measurement) {
  if (!measurement.result.seen) return true;
  const Vector6 off = difference(prediction.world_from_object, measurement.fitted);
  return off.dot(prediction.covariance.ldlt().solve(off)) > kUnexpected;
}

double agreement(const ObjectTracker::TrackResult& result) {
  if (!result.seen) return 0;
  return result.evidence * result.lines_used / std::max(1, result.lines_total);
}

}  // namespace sightline::observe
