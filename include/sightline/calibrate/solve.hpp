// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/calibrate/views.hpp"
#include "sightline/geometry/camera_model.hpp"

namespace sightline {

/// What is known of a camera before it is solved for.
struct CameraPrior {
  LensModel lens = LensModel::kBrownConrady;
  std::optional<CameraModel> known;  ///< the lens is held as it is
  double readout_s = 0;              ///< CalibratedCamera::readout_s: where it starts, or is held
};

struct SolveOptions {
  std::vector<CameraPrior> cameras;  ///< by camera; empty: Brown-Conrady, nothing known
  size_t reference = 0;              ///< the camera whose frame is the world's
  bool bend = false;                 ///< the target may be bent (two parameters)
  bool time_offsets = false;         ///< each camera's stamps may be late (needs a moving target)
  bool readouts = false;             ///< each camera's read-out is solved for (likewise)
  double huber_px = 0;               ///< robust loss beyond this error; 0: none
  /// Corners farther off than so many robust standard deviations of their camera are left out, in
  /// up to three rounds; 0: none are.
  double reject_sigmas = 6;
  size_t min_corners = 6;  ///< a view with fewer is not used
  size_t min_views = 5;    ///< of a camera whose lens is solved for; known lenses need two
  int threads = 1;
};

struct ParameterEstimate {
  std::string name;  ///< "fx", "k1", "time_offset_s", "readout_s"
  double value = 0, sigma = 0;
};

/// A camera after the solution.
struct SolvedCamera {
  CalibratedCamera camera;  ///< world: the frame of the reference camera; rms_px of its corners
  bool lens_known = false;
  double time_offset_s = 0;                    ///< its images are taken so much later than stamped
  std::vector<ParameterEstimate> estimates{};  ///< of the lens, those that were solved for
  /// Covariance of these estimates in their order, then (unless it is the reference camera) of
  /// world_from_camera's tangent (rotation [rad], translation [m], perturbed on the right).
  Eigen::MatrixXd covariance{};
  std::vector<int> lens_columns{};  ///< which of fx fy cx cy k.. (0..11), offset 12, read-out 13
  bool has_place = false;
  Matrix6 place_covariance() const;  ///< zero for the reference camera
  size_t views = 0, corners = 0, rejected = 0;
};

struct RigSolution {
  std::vector<SolvedCamera> cameras;
  std::vector<std::optional<Rigid3>> world_from_target;  ///< by set; empty: not used
  std::vector<std::vector<char>> used;                   ///< by view and corner
  Eigen::Vector2d bend = Eigen::Vector2d::Zero();        ///< [m], see SolveOptions::bend
  Eigen::Vector2d bend_sigma = Eigen::Vector2d::Zero();
  double rms_px = 0;    ///< of the distance in the image, over all used corners
  double sigma_px = 0;  ///< of one coordinate: sqrt(cost / degrees of freedom)
  int iterations = 0;
  size_t corners = 0, rejected = 0;
};

/// Solves for all lenses and places jointly (bundle adjustment), from nothing. Refused by name, in
/// words for a person: what check_views() refuses, a camera of another image size than its known
/// lens, too few views, no tilt or no change of distance where the focal length is solved for,
/// cameras that nothing links (which, and what would), a target that does not fit (wrong size or
/// layout), known lenses that fit better exchanged, what is not determined by the views.
Result<RigSolution> solve_rig(const CalibrationViews& views, const SolveOptions& options);

/// The same from a solution near by (views left out or added): no search for a start.
Result<RigSolution> resolve_rig(const CalibrationViews& views, const SolveOptions& options,
                                const RigSolution& start);

/// calibration.toml of a solution: cameras, sigmas and date.
std::string format_solution(const RigSolution& solution, const std::string& date,
                            const std::string& remark);

/// Error of every corner [px], projection less measurement, by view and corner of `views`; NaN
/// where it does not project or its set has no pose.
std::vector<std::vector<Eigen::Vector2d>> corner_errors(const CalibrationViews& views,
                                                        const RigSolution& solution);

}  // namespace sightline
