// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/judge/moving_detections.hpp"

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {
namespace {

const Rigid3& pose_of(const Detection& found) { return found.poses.front().world_from_object; }

}  // namespace

bool MovingDetections::confirms(const Detection& found) {
  if (found.poses.empty() || !follows(found)) row_.clear();
  if (found.poses.empty()) return false;
  row_.push_back(found);
  if (row_.size() < kMovingRow) return false;
  const bool moved = has_moved();
  row_.clear();
  if (!moved) row_.push_back(found);
  return moved;
}

const Detection* MovingDetections::promising() const {
  if (newest() != nullptr || row_.empty()) return newest();
  const Detection& found = row_.back();
  const double score = found.poses.front().evidence;
  return score >= kMinWeakScore && found.runner_up <= kMaxRivalOfMoving * score ? &found : nullptr;
}

Eigen::Vector3d MovingDetections::place(const Detection& found) const {
  return pose_of(found) * center_;
}

bool MovingDetections::follows(const Detection& found) const {
  if (row_.empty()) return true;
  const Detection& last = row_.back();
  const double seconds = to_seconds(found.time - last.time);
  if (seconds <= 0 || seconds > kMaxSecondsBetweenWeak) return false;
  const double turn = turn_(pose_of(last), pose_of(found));
  if (turn > kMovingTurn + kWeakTurnRate * seconds) return false;
  const Eigen::Vector3d step = place(found) - place(last);
  if (row_.size() < 2) return step.norm() < kMovingPlace * radius_ + kWeakSpeed * seconds;
  const Detection& first = row_[row_.size() - 2];
  const double before = to_seconds(last.time - first.time);
  const Eigen::Vector3d expected = (place(last) - place(first)) * (seconds / before);
  return (step - expected).norm() < kMovingPlace * radius_ + kMovingUnsteadySpeed * seconds;
}

// By more than an edge's width, as a whole.
bool MovingDetections::has_moved() const {
  const Detection &first = row_.front(), &last = row_.back();
  return (place(last) - place(first)).norm() > kMovedDistance * radius_ ||
         turn_(pose_of(first), pose_of(last)) > kMovedAngle;
}

}  // namespace sightline::observe
