// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/calibrate/views.hpp"
#include "sightline/geometry/camera_model.hpp"

namespace sightline {

/// A point whose place in the world is known, and where a camera shows it.
struct SurveyedSight {
  std::string camera;
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();  ///< [m]
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

/// Rows `x,y,z,camera,u,v` under that header; rows of the same x,y,z are one point.
Result<std::vector<SurveyedSight>> parse_surveyed_points(std::string_view text,
                                                         const std::string& where);

struct WorldPlacement {
  std::vector<CalibratedCamera> cameras;  ///< the same rig in the new world
  size_t points = 0;
  double rms_mm = 0;  ///< of the points after the fit
  double scale = 1;   ///< length in the world over length in the rig, as measured (not applied)
};

/// The world of a target that lies on the floor, its print up: origin at its top-left corner, x
/// along the print to the right, y along it upwards, z up out of it. The first set of the views in
/// which it is seen counts. Refused: a target that nobody sees, cameras below the floor (more than
/// half: it lies face down, or the floor is a ceiling).
Result<WorldPlacement> world_of_target(const CalibrationViews& views,
                                       const std::vector<CalibratedCamera>& cameras);

/// The world of surveyed points, each seen by two cameras or more: triangulated, then laid over
/// each other without scale (Umeyama, 1991). Refused: fewer than three points or points on a line,
/// unknown cameras, a scale that is off by more than 2 % (units, or a wrong target size).
Result<WorldPlacement> world_of_points(const std::vector<SurveyedSight>& sights,
                                       const std::vector<CalibratedCamera>& cameras);

/// An axis of the world, and which way along it.
struct WorldAxis {
  int index = 0;  ///< 0 x, 1 y, 2 z
  int sign = 1;   ///< -1: against it
};
/// "x", "-x", "y", ...
Result<WorldAxis> parse_world_axis(std::string_view text);

struct MotionPlacement {
  std::vector<CalibratedCamera> cameras;  ///< the same rig in the new world
  size_t places = 0;                      ///< of the target, one a set
  double travel = 0;                      ///< from one end to the other [m]
  double rms_mm = 0;                      ///< beside the line
  double sigma_deg = 0;                   ///< of the direction
  double up_turned_deg = 0;               ///< angle from the world's z of before to that of now
};

/// The world turned about its origin, so that a target that was moved along a straight line, in the
/// order of the sets, moved along `axis`. For x and y the world's z stays as near to what it was
/// as it can; for z its x does. The middle of the target counts: triangulated where two cameras
/// have six corners in common, otherwise by the camera that sees most corners. `length`: how far it
/// was moved, if that was measured [m]; it checks the scale.
///
/// Refused: fewer than five places; a way of less than 50 mm, or too short for the noise (0.5
/// degrees); a curved or crooked one (0.5 % of the way off, and beyond the noise; 2 % RMS); back
/// and forth; x or y within 20 degrees of the world's z; z with the cameras upside down; a length
/// that is off by more than 2 %.
Result<MotionPlacement> world_of_motion(const CalibrationViews& views,
                                        const std::vector<CalibratedCamera>& cameras,
                                        WorldAxis axis, std::optional<double> length);

}  // namespace sightline
