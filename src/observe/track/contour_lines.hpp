// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "observe/shape/revolved_surface.hpp"
#include "observe/terms/line_jacobian.hpp"
#include "observe/track/colors/appearance.hpp"
#include "sightline/model/depth_renderer.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline::observe {

/// One correspondence line: placed at a pose, then measured in an image.
struct ContourLine {
  Eigen::Vector3d point_in_object;
  Eigen::Vector2d center;  ///< distorted pixel of the point
  Eigen::Vector2d normal;  ///< unit, outwards
  Vector6 by_pose;         ///< d (normal . pixel) / d tangent
  bool crease = false;     ///< not the limb of a smooth surface
  double inside_px = 0;    ///< how far the silhouette reaches inwards without a gap
  double outside_px = 0;   ///< how far there is none of it outwards

  bool measured = false;
  double mean = 0;      ///< offset of the outline along the normal [px]
  double variance = 0;  ///< of the posterior [px^2]
  /// Mean evidence (-1 .. 1) of the pixels inside and outside the placed outline.
  float inside_evidence = 0, outside_evidence = 0;
  /// Mean luma there.
  float inside_level = 0, outside_level = 0;
};

/// Another object, as a sphere that hides what is behind it.
struct OccludingSphere {
  Eigen::Vector3d center_in_camera;
  double radius = 0;
};

/// What may stand between a camera and the object.
struct Occluders {
  DepthTile scene;  ///< static scene, whole image; width 0: none
  std::span<const OccludingSphere> spheres;

  /// True if the scene or another object is in front of a point at this pixel, or so near that a
  /// line through it would cross its outline.
  bool hide(const Eigen::Vector2d& pixel, const Eigen::Vector3d& point_in_camera) const;
  /// How far one can go along a line's normal (`sign` 1) or against it (-1), at most `reach_px`,
  /// before the scene is in front of the range of the outline.
  double free_way(const ContourLine& line, double range, int sign, double reach_px) const;
};

/// Places the lines of a view at a pose, through the exact lens. Lines that do not project, leave
/// the image (by `margin_px`), or are hidden are left out. `revolved`: what of the object turns
/// about its axis do not move; null: nothing.
void place_lines(const View& view, const CameraModel& camera, const Rigid3& camera_from_object,
                 const Occluders& occluders, double margin_px, const RevolvedSurface* revolved,
                 std::vector<ContourLine>& out);

/// Measures each line by color: the posterior of the outline's offset under the statistics, with a
/// smoothed step between object and background (Stoiber et al., SRT3D, 2022, equations 7 to 14):
///     p(d | line) ~ product over r of  1 - 2 T(r - d) w(r),   T(x) = a tanh(x / 2 s),
/// with w the evidence of the pixels at distance r and T the difference of the step functions. One
/// segment is `scale` pixels; offsets up to eight segments are tried. A line whose silhouette is
/// thinner than a segment allows is not measured.
void measure_lines(const ColorReader& frame, const ColorHistograms& colors, int scale,
                   std::span<ContourLine> lines);

/// Moves the offsets of lines measured at scale 1 to where light, not level, is halfway between
/// inside and outside: a blurred step from light b to a crosses the middle level at the share
///     t = (((a^(1/g) + b^(1/g)) / 2)^g - b) / (a - b)
/// of the light, which lies blur * Phi^-1(t) from its middle: bright things appear too large.
void correct_for_gamma(double gamma, double blur_px, std::span<ContourLine> lines);

/// Bins of the pixels inside and outside, for learning: `gap_px` next to the outline is left out,
/// then `reach_px` of either side where they belong to it beyond doubt.
void collect_colors(const ColorReader& frame, std::span<const ContourLine> lines, double gap_px,
                    double reach_px, std::vector<uint16_t>& foreground,
                    std::vector<uint16_t>& background);

}  // namespace sightline::observe
