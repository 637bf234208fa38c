// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "edge_maps.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "template_bank.hpp"

namespace sightline {

/// What the search sees of one camera: responses to edges spread over 1, 2, ... half-size pixels.
struct SearchCamera {
  static constexpr int kSpreads = 7;
  const CalibratedCamera* camera = nullptr;
  Rigid3 camera_from_world;
  double shrink = 4;   ///< picture pixels per pixel of the maps
  double seconds = 0;  ///< captured after the camera that is searched
  std::array<ResponseMaps, kSpreads> maps;

  /// Of the spread that allows for what the steps of the search leave open: the larger the object
  /// looks (`scale` [px/m of the maps], `radius` [m]), the more its outline moves from one step to
  /// the next, and while it moves from one camera's exposure to the other's.
  const ResponseMaps& far(double scale, double radius) const;
  /// Of the spread that its motion alone asks for.
  const ResponseMaps& near(double scale) const;

 private:
  int motion_px(double scale) const;
};

struct JointPose {
  Rigid3 world_from_object;
  double score = 0;
};

/// Scores whole poses in all cameras together.
class JointSearch {
 public:
  enum class Spread { kFar, kNear };

  JointSearch(const TemplateBank& bank, std::span<const SearchCamera> cameras)
      : bank_(bank), cameras_(cameras) {}

  /// Sum over cameras of what the response exceeds that of clutter by; cameras that do not have
  /// the object's centre in their picture say nothing.
  double score(const Rigid3& world_from_object, Spread spread) const;
  /// Response in one camera, 0..1; negative: out of its picture.
  double camera_score(size_t camera, const Rigid3& world_from_object, Spread spread) const;

  /// Tries all views, turns and places of one camera at each distance; `most` hits of all distances
  /// together, each with as many.
  std::vector<ScanHit> scan_camera(size_t camera, ScanRange range) const;

  /// Takes hits of one camera to the depth at which the others agree best. Best first, at most
  /// `most`, no two alike.
  std::vector<JointPose> verify(size_t camera, std::span<const ScanHit> hits,
                                const ScanRange& range, size_t most) const;

  /// climb_pose() on the joint score.
  JointPose climb(const JointPose& start, Spread spread, double turn, double shift,
                  int halvings) const;

 private:
  struct Sweep;
  std::optional<Sweep> sweep(const SearchCamera& seen_by, const Rigid3& world_from_object) const;
  double sweep_score(const Sweep& sweep, const Eigen::Vector3d& center_in_world) const;

  const TemplateBank& bank_;
  std::span<const SearchCamera> cameras_;
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

/// Best first; drops what is within so much [m, rad] of a better one.
void drop_alike(std::vector<JointPose>& poses, double distance, double angle);

}  // namespace sightline
