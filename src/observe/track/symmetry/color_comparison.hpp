// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "observe/track/contour_lines.hpp"
#include "observe/track/tracker_camera.hpp"
#include "sightline/image/planes.hpp"

namespace sightline::observe {

/// Tells poses apart by the colors of the mesh, where they differ: a label that one pose shows
/// here, and another one elsewhere or not at all. What the materials look like under this light is
/// read from the rest of the same side of the object; that the label is there, its contrast to that
/// has to say, in the direction that the mesh's colors have. docs/tracking.md, "Colors compared".
class ColorComparison {
 public:
  /// The object's `colors` renderers.
  ColorComparison(const TrackerCamera& camera, const TrackedObject& object);

  /// -log likelihood of each of the poses (world_from_object), up to a common constant; the first
  /// is the fitted one, the others look nearly the same. Empty if the image does not tell: the
  /// object is out of it, too small, the poses show the same, or none of them explains what is
  /// there. Draws the mesh once for each.
  const std::vector<double>& compare(const I420View& image, std::span<const Rigid3> poses,
                                     const Occluders& occluders);

 private:
  using Planes = std::array<std::vector<float>, 3>;  ///< Y, U, V of the cells
  /// What one side of the object looks like where the poses agree.
  struct Side {
    std::array<float, 3> painted{}, shown{}, spread{};  ///< Y, U, V [levels]
    double rest = 0;  ///< mean square of what it varies by, all channels [spread^2]
    bool known = false;
  };
  /// The image at its own size, and at halves of it for what is large there.
  struct Level {
    std::unique_ptr<CameraModel> model;
    std::unique_ptr<ColorRenderer> renderer;
  };

  bool aim(const Rigid3& camera_from_object);
  bool draw_all(std::span<const Rigid3> poses);
  void begin(const ColorTile& tile);
  void take(const ColorTile& tile, Planes& painted);
  void smooth(int reach, Planes& planes);
  void leave_out_hidden(const Occluders& occluders);
  void measure_borders();
  void read(const I420View& image);
  void sort_cells(size_t poses);
  Side learn(std::vector<uint32_t>& cells);
  void add_costs(size_t poses);

  const TrackerCamera& camera_;
  const TrackedObject& object_;
  std::array<Level, 5> levels_;  ///< each half of the one before; made when first needed
  Level* level_ = nullptr;
  int scale_ = 1;                               ///< pixels to a cell
  int x_ = 0, y_ = 0, width_ = 0, height_ = 0;  ///< of the first pose's tile
  std::vector<Planes> painted_;                 ///< by pose
  Planes shown_;
  std::vector<float> depth_;    ///< 1/z of the first pose
  std::vector<uint8_t> side_;   ///< of the first pose
  std::vector<uint16_t> free_;  ///< by how many poses it is covered; then steps to the next border
  std::vector<uint32_t> differ_;                  ///< cells at which the poses' colors do
  std::array<std::vector<uint32_t>, 256> agree_;  ///< the others, by side
  std::array<Side, 256> sides_;
  std::vector<double> along_, expected_;  ///< by pose
  std::vector<float> scratch_;
  std::vector<double> costs_;
};

}  // namespace sightline::observe
