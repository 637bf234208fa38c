// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <vector>

#include "observe/detect/search_camera.hpp"
#include "observe/detect/template_bank.hpp"
#include "sightline/base/executor.hpp"

namespace sightline::observe {

struct JointPose {
  Rigid3 world_from_object;
  double score = 0;
  double colors = 0;  ///< MeshColors::agreement(), where it was asked for
};

/// Scores whole poses in all cameras together.
class JointSearch {
 public:
  enum class Spread { kFar, kNear };

  JointSearch(const TemplateBank& bank, std::span<const SearchCamera> cameras,
              const Executor& executor)
      : bank_(bank), cameras_(cameras), executor_(executor) {}

  /// Sum over cameras of what the response exceeds that of clutter by; cameras that do not have
  /// the object's center in their image say nothing.
  double score(const Rigid3& world_from_object, Spread spread) const;
  /// Response in one camera, 0..1; negative: out of its image.
  double camera_score(size_t camera, const Rigid3& world_from_object, Spread spread) const;

  /// Moves hits of one camera to the depth at which the others agree best. Best first.
  std::vector<JointPose> verify(size_t camera, std::span<const ScanHit> hits,
                                const ScanRange& range) const;

  /// climb_pose() on the joint score.
  JointPose climb(const JointPose& start, Spread spread, double turn, double shift,
                  int halvings) const;
  /// The same for each of them.
  void climb(std::vector<JointPose>& poses, Spread spread, double turn, double shift,
             int halvings) const;

 private:
  struct Sweep;
  /// A hit at the depth at which the other cameras agree best; empty: it is no pose.
  std::optional<JointPose> verify(size_t camera, const ScanHit& hit, const ScanRange& range) const;
  std::optional<Sweep> sweep(const SearchCamera& seen_by, const Rigid3& world_from_object) const;
  double sweep_score(const Sweep& sweep, const Eigen::Vector3d& center_in_world) const;

  const TemplateBank& bank_;
  std::span<const SearchCamera> cameras_;
  const Executor& executor_;
};

/// Steps in place [m] and direction [rad] about `center`, halved until none helps to a higher
/// score.
template <typename Score>
JointPose climb_pose(const Rigid3& start, const Eigen::Vector3d& center, double turn, double shift,
                     int halvings, const Score& score) {
  JointPose best{start, score(start)};
  for (int level = 0; level <= halvings; turn /= 2, shift /= 2, ++level) {
    for (int round = 0; round < 4; ++round) {
      bool moved = false;
      for (int axis = 0; axis < 6; ++axis) {
        for (const double sign : {1.0, -1.0}) {
          Rigid3 next = best.world_from_object;
          if (axis < 3) {
            const Eigen::Vector3d fixed = next * center;
            next.rotation =
                next.rotation * Eigen::AngleAxisd(sign * turn, Eigen::Vector3d::Unit(axis));
            next.rotation.normalize();
            next.translation = fixed - next.rotation * center;
          } else {
            next.translation[axis - 3] += sign * shift;
          }
          const double value = score(next);
          if (value <= best.score) continue;
          best = {next, value};
          moved = true;
          break;
        }
      }
      if (!moved) break;
    }
  }
  return best;
}

/// Sorts, best first, and drops what is within so much [m, rad] of a better one.
void remove_duplicates(std::vector<JointPose>& poses, double distance, double angle);

}  // namespace sightline::observe
