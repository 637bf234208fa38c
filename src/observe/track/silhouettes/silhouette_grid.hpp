// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "observe/track/colors/appearance.hpp"
#include "observe/track/contour_lines.hpp"
#include "observe/track/tracker_camera.hpp"

namespace sightline::observe {

/// A grid of cells upright on the line of sight to an object: which of its poses cover each cell,
/// and the color of the image there.
class SilhouetteGrid {
 public:
  static constexpr int kSide = 64;  ///< cells
  static constexpr size_t kCells = size_t{kSide} * kSide;
  static constexpr uint16_t kUnknown = 0xffff;

  /// Draws by the object's `silhouette` renderers. `filled`: of the grid's side by the bounding
  /// sphere.
  SilhouetteGrid(const TrackerCamera& camera, const TrackedObject& object, double filled);

  /// Places the grid on the object at `world_from_object` and clears it. False if the object is too
  /// near (the grid's perspective would be wrong) or too small in the image.
  bool aim(const Rigid3& world_from_object);
  /// Adds `bit` to the cells that the object covers at the pose of aim() * `turn`.
  void draw(const Rigid3& turn, uint32_t bit);
  /// Bins of the pixels under the cells, kUnknown outside of the image and where something known
  /// is in front; `without_others`: also where another object may be behind.
  void read(const ColorReader& image, const Occluders& occluders, bool without_others = false);

  const std::vector<uint32_t>& covered() const { return covered_; }
  const std::vector<uint16_t>& bins() const { return bins_; }

 private:
  const TrackerCamera& camera_;
  const TrackedObject& object_;
  std::unique_ptr<DepthRenderer> renderer_;
  Rigid3 camera_from_object_, grid_from_object_;
  Eigen::Quaterniond camera_from_grid_ = Eigen::Quaterniond::Identity();
  std::vector<uint32_t> covered_;
  std::vector<uint16_t> bins_;
};

}  // namespace sightline::observe
