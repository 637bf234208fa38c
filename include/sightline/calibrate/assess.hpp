// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/calibrate/solve.hpp"
#include "sightline/calibrate/views.hpp"

namespace sightline {

enum class CalibrationGrade { kGood, kUsable, kNotGood };

/// One sigma of the place at which the camera's lens shows a point at the working distance, the
/// camera's pose free: what a wrong lens costs that no pose makes good [px].
struct ProjectionSigma {
  int columns = 0, rows = 0;   ///< of the grid, evenly over the image
  std::vector<double> values;  ///< row by row; NaN where the lens shows nothing
  double center = 0;
  double edge = 0;      ///< median of the grid's outermost cells
  double worst = 0;     ///< of the grid
  double distance = 0;  ///< of the point [m]
};

/// How two calibrations, each from half of the sets, differ.
struct SplitHalf {
  double center_mm = 0, rotation_deg = 0;  ///< of the camera, relative to the reference camera
  double median_px = 0, worst_px = 0;      ///< of the projection of the target's corners
  double median_mm = 0, worst_mm = 0;      ///< the same at the corner's distance
  /// The same all over the image, at the median distance of the corners: a grid, row by row; NaN
  /// where one of the two shows nothing.
  int columns = 0, rows = 0;
  std::vector<double> px;
};

struct CameraReport {
  std::string name;
  double coverage = 0;  ///< share of the image's 10x8 cells with a corner in them
  std::optional<double> held_out_px;
  std::optional<SplitHalf> split_half;
  std::optional<ProjectionSigma> sigma;  ///< at the working distance; empty: the lens was given
  std::optional<ProjectionSigma> sigma_near, sigma_far;  ///< at the nearest and farthest corner
  double working_distance = 0;                           ///< median distance of the target [m]
  double place_sigma_mm = 0, place_sigma_deg = 0;
  double tilt_deg = 0;               ///< largest angle between two planes of the target
  double depth_ratio = 0;            ///< farthest over nearest corner
  double nearest = 0, farthest = 0;  ///< corner [m]
  CalibrationGrade grade = CalibrationGrade::kGood;
  std::vector<std::string> remarks;  ///< sentences: the verdict, and what to do
};

struct LinkReport {
  size_t a = 0, b = 0;  ///< cameras
  size_t sets = 0;      ///< in which both saw the target
};

/// Lengths on the target, from its corners triangulated in each set, against the print.
struct RigidityReport {
  double rms_mm = 0;       ///< of all distances between two corners
  double adjacent_mm = 0;  ///< of distances between neighbors, RMS
  double scale = 1;        ///< measured over printed length, mean
  size_t distances = 0;
};

struct RigReport {
  std::vector<CameraReport> cameras;
  std::vector<LinkReport> links;
  /// Of the strongest links that together reach every camera, the weakest first (indices of
  /// `links`): where the rig comes apart first.
  std::vector<size_t> weakest;
  std::optional<double> held_out_px;  ///< over all cameras
  std::optional<RigidityReport> rigidity;
  CalibrationGrade grade = CalibrationGrade::kGood;  ///< the worst camera's
};

/// Judges a solution by what was not used for it: solves again with every other set, predicts the
/// others (each camera from the target's pose in the other cameras; with one camera, every other
/// corner from the rest), and compares the two halves. What cannot be had is left empty.
Result<RigReport> assess_rig(const CalibrationViews& views, const SolveOptions& options,
                             const RigSolution& solution);

/// A solution with its report.
struct SolvedRig {
  RigSolution solution;
  RigReport report;
};
/// solve_rig(), then assess_rig().
Result<SolvedRig> solve_and_assess(const CalibrationViews& views, const SolveOptions& options);

/// Lengths on the target as these cameras see them, at the times that their time offsets and
/// read-outs say (any calibration, not only a solution's own).
std::optional<RigidityReport> rigidity(const CalibrationViews& views,
                                       const std::vector<CalibratedCamera>& cameras);

/// Error of prediction: the target's pose in each set from the other cameras (from every other
/// corner if `alone`), projected into the camera [px, RMS]; by camera, empty where nothing could be
/// predicted. Only sets of `which` (by set).
struct HeldOut {
  std::vector<std::optional<double>> by_camera;
  std::optional<double> all;
};
HeldOut held_out_error(const CalibrationViews& views, const RigSolution& solution,
                       const std::vector<char>& which);

std::string to_string(CalibrationGrade grade);

/// The report as JSON, and as one HTML file that needs nothing beside it (plots are SVG).
std::string report_json(const CalibrationViews& views, const RigSolution& solution,
                        const RigReport& report, const std::string& epoch);
std::string report_html(const CalibrationViews& views, const RigSolution& solution,
                        const RigReport& report, const std::string& epoch);

}  // namespace sightline
