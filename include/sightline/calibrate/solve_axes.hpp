// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/calibrate/head_sights.hpp"
#include "sightline/geometry/camera_model.hpp"

namespace sightline {

/// What is done with angles per reading.
enum class AxesScales {
  /// Solved for; where the lens is, too, held at 1 or -1 if they may be that: focal length and
  /// scale are hard to tell apart.
  kAuto,
  kFree,  ///< solved for
  kHold   ///< readings are degrees: only their signs are found
};

struct AxesOptions {
  bool refine_lens = false;  ///< solve for the lens, too (a zoom's lenses always are)
  bool zoom = false;         ///< make a zoom table: settings at two or more values of the zoom
  AxesScales scales = AxesScales::kAuto;
  bool world_of_target = false;  ///< the world is that of the first body, its print up
  size_t min_settings = 8;       ///< at which the head stood still and saw something
  size_t min_corners = 6;        ///< of a setting that counts
};

/// Something that was solved for, or held, and why.
struct AxesEstimate {
  std::string name, unit;
  double value = 0, sigma = 0;  ///< [unit]; sigma 0: held
  std::string held = {};        ///< why it was not solved for, and what to do; empty: it was
};

/// One place at which the head stood still, or one image of it in motion.
struct SolvedSetting {
  std::string recording;
  double time_s = 0;  ///< since the recording's first image
  bool moving = false, used = true;
  double pan_deg = 0, tilt_deg = 0;  ///< as read, at that time
  double pan_rate_deg_s = 0, tilt_rate_deg_s = 0;
  double zoom = 0;
  size_t images = 0, corners = 0;
  double rms_px = 0;                       ///< of its corners, angles as estimated
  double angle_error_deg[2] = {0, 0};      ///< pan, tilt: seen less read
  std::optional<double> held_out_px = {};  ///< predicted by those that were not left out
  std::optional<double> held_out_deg = {}, held_out_mm = {};
};

/// Where the curve of the fit over the latency is lowest.
struct LatencyCurve {
  std::vector<double> latency_s, rms_deg;  ///< of what the picture says less the readings
};

/// Rows of the covariance of a solution, in this order; sigmas of what is held are 0.
enum AxesParameter : int {
  kBase = 0,    ///< 6: tangent of world_from_base (rotation, translation), on the right
  kTwist = 6,   ///< tilt axis from perpendicular to the pan axis [rad]
  kOffset = 7,  ///< of the two axes at their nearest [m]
  kMount = 8,   ///< 6: tangent of tilt_from_camera, on the right
  kPanScale = 14,
  kTiltScale = 15,
  kPanPlay = 16,   ///< [rad] of readings
  kTiltPlay = 17,  ///< [rad] of readings
  kLatency = 18,   ///< [s]
  kAxesParameters = 19,
};

struct AxesSolution {
  CalibratedCamera camera;  ///< with its axes; rms_px of its corners
  Eigen::Matrix<double, kAxesParameters, kAxesParameters> covariance;
  std::vector<AxesEstimate> estimates = {};
  std::vector<SolvedSetting> settings = {};
  std::vector<Rigid3> world_from_body = {};
  LatencyCurve latency = {};
  double pan_play = 0, tilt_play = 0;  ///< [rad] of readings, the whole gap
  double jitter_s = 0;                 ///< scatter of the latency from image to image, one sigma
  double reading_sigma = 0;            ///< of an angle, what the readings do not explain [rad]
  double sigma_px = 0;                 ///< of one coordinate of a corner
  double rms_px = 0;                   ///< of the distance in the image, settings at rest
  size_t corners = 0, rejected = 0;    ///< settings at rest
  size_t settings_left_out = 0;        ///< of those at rest
  bool lens_refined = false;
  std::string world = {};                  ///< in words: what ties it to the world
  std::vector<ZoomLens> lens_sigmas = {};  ///< of each lens that was solved for, fx to distortion
  /// Where corners of settings at rest are seen, and projection less measurement [px].
  std::vector<Eigen::Vector2d> pixels = {}, errors = {};
  std::vector<std::string> remarks = {};  ///< what was found odd, in sentences

  /// One sigma of the place of the camera at readings of these angles [rad]: direction [rad], place
  /// [m], largest over directions; the readings' own noise left out.
  Eigen::Vector2d place_sigma(double pan, double tilt) const;
};

/// Solves jointly for the axes of a pan and tilt head, the scales, play, latency and noise of its
/// readings, the places of boards and, if asked for, lenses: corners of all images, weighted by
/// their noise, and one unknown error of each angle at each setting, weighted by that of the
/// readings; both noises are estimated along (Helmert's variance components). A start is found
/// from nothing: rotations by the Kronecker product (Shah, "Solving the robot-world/hand-eye
/// calibration problem using the Kronecker product", 2013), places linearly.
///
/// The chain of two axes has 14 parameters, world_from_base and tilt_from_camera have 12 of them;
/// of pan_from_tilt two are left, as Denavit and Hartenberg (1955) count: it is a turn about y
/// (`twist`) and a shift along y (`offset`), so that base and tilt frame lie where the two axes are
/// nearest, and x of the base is the tilt axis at a pan reading of zero. z of the base is on the
/// camera's upper side, x of the tilt frame on its right; the signs of the scales follow.
///
/// `calibration` has the head's camera (lens; its axes, if it has some, are where what cannot be
/// known is taken from) and the others. Refused by name, with what to do: no or too few readings,
/// angles that never change, too few settings, an axis that was not turned, angles that stand while
/// the picture turns, a body that was moved, a zoom that changes without a table, cameras without
/// lens or of another image size, nothing that ties the head to the world, numbers that are not
/// finite, what does not fit at all.
Result<AxesSolution> solve_axes(const HeadSights& sights,
                                const std::vector<CalibratedCamera>& calibration,
                                const AxesOptions& options);

}  // namespace sightline
