// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/judge/weak_detections.hpp"

#include <algorithm>
#include <numeric>

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {
namespace {

// Two of these in a row are enough.
bool stands_out(const Detection& found) {
  const double score = found.poses.front().evidence;
  return score >= kMinContourScore || found.runner_up <= kMaxContourRival * score;
}

}  // namespace

bool WeakDetections::confirms(const Detection& found) {
  if (found.poses.empty() || !follows(found)) clear();
  if (found.poses.empty()) return false;
  row_.push_back(found);
  const double odds =
      std::accumulate(row_.begin() + static_cast<ptrdiff_t>(uncounted_), row_.end(), 0.0,
                      [](double sum, const Detection& each) { return sum + each.log_odds; });
  if (row_.size() >= 2 + uncounted_ && odds >= kOddsOfRow) {
    clear();
    return true;
  }
  const size_t needed = std::all_of(row_.begin(), row_.end(), stands_out) ? 2 : 3;
  if (row_.size() < needed + uncounted_) return false;
  clear();
  return true;
}

void WeakDetections::keep(const Detection& found) {
  if (found.poses.empty() || row_.size() > uncounted_) return;
  row_.assign(1, found);
  uncounted_ = 1;
}

Eigen::Vector3d WeakDetections::place(const Detection& found) const {
  return found.poses.front().world_from_object * center_;
}

bool WeakDetections::follows(const Detection& found) const {
  if (row_.empty() || !consistent(row_.back(), found)) return false;
  return row_.size() < 2 || steady(row_[row_.size() - 2], row_.back(), found);
}

// The object may have moved from one to the other.
bool WeakDetections::consistent(const Detection& earlier, const Detection& now) const {
  const double seconds = std::abs(to_seconds(now.time - earlier.time));
  if (seconds > kMaxSecondsBetweenWeak) return false;
  const Rigid3& pose = now.poses.front().world_from_object;
  return std::any_of(earlier.poses.begin(), earlier.poses.end(), [&](const DetectedPose& other) {
    const Rigid3& before = other.world_from_object;
    return (before * center_ - pose * center_).norm() <
               kOtherPlace * radius_ / 2 + kWeakSpeed * seconds &&
           rotation_angle(before, pose) < kSameFittedAngle + kWeakTurnRate * seconds;
  });
}

// It went on as it had moved before.
bool WeakDetections::steady(const Detection& first, const Detection& second,
                            const Detection& now) const {
  const double before = to_seconds(second.time - first.time);
  const double after = to_seconds(now.time - second.time);
  if (before <= 0 || after <= 0) return false;
  const Eigen::Vector3d velocity = (place(second) - place(first)) / before;
  const Eigen::Vector3d expected = place(second) + velocity * after;
  return (place(now) - expected).norm() < kOtherPlace * radius_ / 2 + kUnsteadySpeed * after;
}

}  // namespace sightline::observe
