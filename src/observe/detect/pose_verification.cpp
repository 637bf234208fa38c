// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/pose_verification.hpp"

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {

using Spread = JointSearch::Spread;

std::vector<JointPose> PoseVerification::by_edges(const DetectorFrames& frames,
                                                  const ScanResult& scanned) const {
  return JointSearch(bank_, frames.search_cameras(), executor_)
      .verify(scanned.camera, scanned.hits, scanned.range);
}

std::vector<Rigid3> PoseVerification::by_silhouettes(
    const DetectorFrames& frames, std::span<const SilhouetteCamera> cameras) const {
  std::vector<Rigid3> out;
  if (cameras.empty()) return out;
  const JointSearch search(bank_, frames.search_cameras(), executor_);
  const double radius = bank_.model().radius();
  for (const JointPose& pose : silhouettes_.search(cameras, kMaxSilhouettes)) {
    out.push_back(pose.world_from_object);
    out.push_back(search.climb(pose, Spread::kNear, 0.08, 0.12 * radius, 3).world_from_object);
  }
  return out;
}

std::vector<Rigid3> PoseVerification::follow(const DetectorFrames& frames,
                                             std::span<const SilhouetteCamera> cameras,
                                             const Rigid3& start) const {
  const JointSearch search(bank_, frames.search_cameras(), executor_);
  const double radius = bank_.model().radius();
  JointPose moved = search.climb({start, 0}, Spread::kFar, 0.2, 0.35 * radius, 3);
  moved = search.climb(moved, Spread::kNear, 0.08, 0.12 * radius, 3);
  std::vector<Rigid3> out = {moved.world_from_object};
  if (cameras.empty()) return out;
  const JointPose on_foreground =
      climb_pose(start, bank_.model().center(), 0.2, 0.35 * radius, 3,
                 [&](const Rigid3& pose) { return silhouettes_.score(cameras, pose, 2); });
  out.push_back(on_foreground.world_from_object);
  return out;
}

}  // namespace sightline::observe
