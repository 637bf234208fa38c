// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "observe/track/colors/appearance.hpp"
#include "observe/track/contour_lines.hpp"
#include "observe/track/tracker_camera.hpp"

namespace sightline::observe {

/// Tells poses apart whose silhouettes differ only in a small part: a handle that one of them shows
/// beside the body, and another one elsewhere or not at all. The colors of the object are read
/// where all of the poses cover the image, those of the background where none does; both say to
/// which of them the pixels in between belong.
class SilhouetteComparison {
 public:
  /// The object's near_rotations, and its `silhouette` renderers.
  SilhouetteComparison(const TrackerCamera& camera, const TrackedObject& object);

  /// -log likelihood of `pose` (world_from_object) and of pose * near_rotations[i], up to a common
  /// constant. Empty if the image does not tell: the object is out of it, too small, or has the
  /// colors of what is around it. Draws the mesh once for each; allocates nothing once warm.
  const std::vector<double>& compare(const ColorReader& image, const Rigid3& pose,
                                     const Occluders& occluders);

 private:
  static constexpr int kSide = 64;        ///< cells of the grid that the poses are drawn into
  static constexpr double kDistance = 8;  ///< of the camera that draws them, in radii
  static constexpr uint16_t kUnknown = 0xffff;

  void draw(const Rigid3& camera_from_object, uint32_t bit);
  /// Bins of the pixels under the cells of the grid, kUnknown where they say nothing.
  void read(const ColorReader& image, const Rigid3& camera_from_object,
            const Eigen::Quaterniond& camera_from_grid, const Occluders& occluders);
  bool learn(uint32_t all);

  const TrackerCamera& camera_;
  const TrackedObject& object_;
  std::unique_ptr<DepthRenderer> renderer_;
  std::vector<uint32_t> covered_;  ///< by cell: bit k if pose k covers it
  std::vector<uint16_t> bins_;     ///< by cell
  std::vector<uint16_t> foreground_, background_;
  ColorHistograms colors_;
  std::vector<double> costs_;
};

}  // namespace sightline::observe
