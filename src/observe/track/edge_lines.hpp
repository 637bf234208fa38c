// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <vector>

#include "observe/terms/light_table.hpp"
#include "observe/track/contour_lines.hpp"

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
  int offsets = 0;        ///< found
  bool searched = false;  ///< it lies in the image
  float strength = 0;     ///< of the strongest step, gray levels per pixel
};

/// Appends lines across the outline of contour lines that were placed already: those at creases, or
/// those at limbs of smooth surfaces.
void edges_of_outline(std::span<const ContourLine> lines, bool at_creases, double reach_px,
                      std::vector<EdgeLine>& out);

/// Appends lines across a view's inner edges, placed at a pose.
void place_inner_edges(const View& view, const CameraModel& camera,
                       const Rigid3& camera_from_object, const Occluders& occluders,
                       double reach_px, const RevolvedSurface* revolved,
                       std::vector<EdgeLine>& out);

/// Finds steps of light along each line: maxima of the gradient's magnitude above `threshold`
/// (about gray levels per pixel), to sub-pixel by a parabola, strongest first, those that are
/// weaker than 0.4 of it left out. (Moving edges of Bouthemy, 1989; multiple hypotheses: Vacchetti
/// et al., 2004.)
void find_steps(const PlaneView& gray, const LightTable& light, double threshold,
                std::span<EdgeLine> lines);

}  // namespace sightline::observe
