// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/calibrate/assess.hpp"
#include "sightline/calibrate/views.hpp"

namespace sightline {

/// How a camera stands against its calibration.
struct CameraDrift {
  std::string name;
  std::optional<double> held_out_px;  ///< predicted from the others, calibration in force
  bool anchor = false;                ///< the camera against which the others are measured
  /// calibrated_from_now: where the camera is now in the frame it was calibrated in; tangent and
  /// covariance as everywhere (rotation [rad], translation [m], perturbed on the right).
  Vector6 drift = Vector6::Zero();
  Matrix6 covariance = Matrix6::Zero();
  double rotation_deg = 0, rotation_sigma_deg = 0;
  double shift_mm = 0, shift_sigma_mm = 0;
  bool moved = false;  ///< beyond chance (p < 0.001) and beyond what anybody would mind
  std::string words;   ///< "turned 0.31 deg +- 0.02, shifted 2.1 mm +- 0.3"
};

struct RigCheck {
  std::vector<CameraDrift> cameras;
  std::optional<double> held_out_px;
  std::optional<RigidityReport> rigidity;
  std::vector<CalibratedCamera> now;  ///< the calibration with the places of today
  bool in_order = false;
};

/// Holds new views of a target against the calibration in force: its lenses are held, the places
/// are solved for anew, and the two rigs are laid over each other at the camera with which most
/// others agree (of two cameras nobody can say which one moved). Cameras of the calibration that
/// did not take part are left out. Refused: what solve_rig() refuses, cameras that the calibration
/// does not know, two cameras that fit each other's place.
Result<RigCheck> check_rig(const CalibrationViews& views,
                           const std::vector<CalibratedCamera>& calibration,
                           const SolveOptions& options = {});

}  // namespace sightline
