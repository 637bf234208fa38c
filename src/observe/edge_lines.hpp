// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <vector>

#include "contour_lines.hpp"

namespace sightline::observe {

/// A line across a projected edge and where brightness steps along it.
struct EdgeLine {
  Eigen::Vector3d point_in_object;
  Eigen::Vector2d center;
  Eigen::Vector2d normal;
  Vector6 by_pose;
  size_t line = 0;      ///< of an outline: index of the contour line
  double reach_px = 0;  ///< searched to both sides
  std::array<float, 3> offset{};
  int offsets = 0;     ///< found
  float strength = 0;  ///< of the strongest step, grey levels per pixel
};

/// Appends lines across the outline of contour lines that were placed already: those at creases, or
/// those at limbs of smooth surfaces.
void edges_of_outline(std::span<const ContourLine> lines, bool at_creases, double reach_px,
                      std::vector<EdgeLine>& out);

/// Appends lines across a view's inner edges, placed at a pose.
void place_inner_edges(const View& view, const CameraModel& camera,
                       const Rigid3& camera_from_object, const Hiders& hiders, double reach_px,
                       std::vector<EdgeLine>& out);

/// Light by picture level, scaled so that the slope is 1 in the middle: an edge is where light is
/// halfway, and grey levels are not proportional to it (see edge_refine.hpp).
class LightTable {
 public:
  explicit LightTable(double gamma);
  float operator[](uint8_t level) const { return values_[level]; }

 private:
  std::array<float, 256> values_;
};

/// Finds steps of light along each line: maxima of the gradient's magnitude above `threshold`
/// (about grey levels per pixel), to sub-pixel by a parabola, strongest first, those that are
/// weaker than 0.4 of it left out. (Moving edges of Bouthemy, 1989; multiple hypotheses: Vacchetti
/// et al., 2004.)
void find_steps(const PlaneView& grey, const LightTable& light, double threshold,
                std::span<EdgeLine> lines);

}  // namespace sightline::observe
