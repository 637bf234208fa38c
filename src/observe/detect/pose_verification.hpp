// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "observe/detect/joint_search.hpp"
#include "observe/detect/pose_scan.hpp"
#include "observe/detect/silhouette_search.hpp"

namespace sightline::observe {

/// Second stage of a detection: poses on which all cameras agree. Needs the response maps of the
/// frames.
class PoseVerification {
 public:
  PoseVerification(const TemplateBank& bank, const SilhouetteSearch& silhouettes,
                   Executor executor = run_serially)
      : bank_(bank), silhouettes_(silhouettes), executor_(std::move(executor)) {}

  /// What one camera's scan has found, each at the depth at which the others agree best; best
  /// first.
  std::vector<JointPose> by_edges(const DetectorFrames& frames, const ScanResult& scanned) const;
  /// Of those whose silhouettes fit the foreground: each as it is and moved on to the edges.
  std::vector<Rigid3> by_silhouettes(const DetectorFrames& frames,
                                     std::span<const SilhouetteCamera> cameras) const;
  /// A pose of earlier frames in these: moved to the edges, and (if its cameras are any) to the
  /// foreground.
  std::vector<Rigid3> follow(const DetectorFrames& frames,
                             std::span<const SilhouetteCamera> cameras, const Rigid3& start) const;

 private:
  const TemplateBank& bank_;
  const SilhouetteSearch& silhouettes_;
  const Executor executor_;
};

}  // namespace sightline::observe
