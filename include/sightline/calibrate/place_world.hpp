// SPDX-License-Identifier: Apache-2.0
#pragma once

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

}  // namespace sightline
