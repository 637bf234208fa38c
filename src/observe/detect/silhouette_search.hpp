// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "observe/detect/joint_search.hpp"
#include "observe/detect/pixels/mask_overlap.hpp"
#include "observe/detect/template_bank.hpp"
#include "sightline/observe/terms/foreground_map.hpp"

namespace sightline::observe {

/// A camera whose background is known.
struct SilhouetteCamera {
  const CalibratedCamera* camera = nullptr;
  Rigid3 camera_from_world;
  const ForegroundMap* map = nullptr;
  double nearest = 0, farthest = 0;  ///< distances at which the object is looked for [m]

  /// Sums of foreground (2 a pixel, shadow 1) and of unknown pixels above and left of a corner.
  std::vector<uint32_t> weight, unknown;
  void sum_up();
};

/// Poses whose silhouettes fit the foreground of all cameras. Places first: a ball about the object
/// must hold as much foreground as some view of it and little around it, in at least two cameras
/// (the visual hull of Laurentini, PAMI 1994, tried by balls). Then every view and turn at the best
/// places, by the overlap of silhouette and foreground over their union; then steps in pose.
/// Pixels of which nothing is known and those out of the image count neither way, so that
/// cut-off silhouettes fit by what is left of them; a camera that sees the object hidden adds
/// nothing and takes nothing away.
class SilhouetteSearch {
 public:
  explicit SilhouetteSearch(const TemplateBank& bank);

  /// Best first, at most `max`, no two close together.
  std::vector<JointPose> search(std::span<const SilhouetteCamera> cameras, size_t max) const;

  /// Orientations at a place, of which `cameras` show the object: best first, at most `max`.
  std::vector<JointPose> orientations(std::span<const SilhouetteCamera> cameras,
                                      const Eigen::Vector3d& center, size_t max) const;

  /// Sum over cameras of the overlap above what chance gives; `step` 1 (exact), 2 or 4 (faster).
  double score(std::span<const SilhouetteCamera> cameras, const Rigid3& world_from_object,
               int step) const;
  /// Overlap over union in one camera, 0..1; negative: it cannot say.
  double overlap(const SilhouetteCamera& camera, const Rigid3& world_from_object, int step) const;

  static constexpr double kChance = 0.35;  ///< overlap that a wrong pose reaches

 private:
  struct Place {
    Eigen::Vector3d center;
    double score = 0;
    size_t camera = 0;  ///< that it was found in
    Rigid3 pose;        ///< best one of few
  };
  struct Ball {
    double x = 0, y = 0, radius = 0;  ///< half-size px
  };
  struct RotatedView;
  std::optional<Ball> ball(const SilhouetteCamera& camera, const Eigen::Vector3d& center) const;
  double place_score(const SilhouetteCamera& camera, const Ball& ball) const;
  std::vector<Place> find_places(std::span<const SilhouetteCamera> cameras) const;
  void add_places(std::span<const SilhouetteCamera> cameras, size_t from,
                  std::vector<Place>& out) const;
  std::vector<JointPose> orient(std::span<const SilhouetteCamera> cameras, const Place& place,
                                size_t views, size_t max) const;
  std::vector<float> overlaps(const SilhouetteCamera& camera, const Ball& ball, size_t views) const;

  const TemplateBank& bank_;
  std::vector<MaskPatch::Bits> masks_;
  std::vector<uint16_t> cells_;         ///< of each mask
  std::vector<uint16_t> coarse_view_;   ///< the nearest of the first kViews
  double min_area_ = 0, max_area_ = 0;  ///< of all views, in squared radii
};

}  // namespace sightline::observe
