// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "calibrate/axes/head_settings.hpp"
#include "calibrate/solve/lens_projection.hpp"
#include "sightline/calibrate/solve_axes.hpp"

namespace sightline::calibrate {

/// pan scale, tilt scale, play of pan, of tilt [rad of readings], latency [s]; in the order of
/// AxesParameter.
using EncoderVector = std::array<double, 5>;
inline constexpr int kEncoderLatency = 4;

/// What is solved for.
struct HeadModel {
  Rigid3 world_from_base;
  std::array<double, 2> link{0, 0};  ///< twist [rad], offset [m]: pan_from_tilt
  Rigid3 tilt_from_camera;
  EncoderVector encoder{1, 1, 0, 0, 0};
  LensModel lens = LensModel::kBrownConrady;
  std::vector<LensVector> lenses;  ///< one for each setting of the zoom
  std::vector<Rigid3> world_from_body;

  Rigid3 pan_from_tilt() const;
  Rigid3 world_from_camera(const Eigen::Vector2d& angles) const;
};

/// Which of it is.
struct HeadFreedom {
  bool base = true;
  std::array<bool, 5> encoder{true, true, false, false, false};
  bool lens = false;
  std::vector<char> bodies;
};

/// One setting in the problem.
struct HeadView {
  const HeadSetting* setting = nullptr;
  const HeadTimes* times = nullptr;
  size_t lens = 0;
  Eigen::Vector2d rest = Eigen::Vector2d::Zero();     ///< what is read, of one at rest [rad]
  Eigen::Vector2d scatter = Eigen::Vector2d::Zero();  ///< of the readings while it rests [rad]
  double zoom = 0;
  std::array<int, 2> sides{0, 0};
  /// What the readings are wrong by: seen less read [rad], and what is expected of it, one sigma.
  Eigen::Vector2d error = Eigen::Vector2d::Zero();
  Eigen::Vector2d sigma = Eigen::Vector2d::Constant(1e-3);
  double weight = 1;                         ///< of that expectation; outliers have less than 1
  std::vector<std::vector<double>> weights;  ///< by sight and corner: 0 left out, 1 counts
  bool used = true;

  bool moving() const { return setting->moving; }
};

/// What a camera that stands still sees of a body.
struct FixedView {
  FixedSight sight;
  LensModel lens = LensModel::kBrownConrady;
  LensVector values{};
  Rigid3 world_from_camera;
  std::vector<double> weights;  ///< by corner
};

struct HeadProblem {
  const HeadSights* sights = nullptr;
  HeadModel model;
  HeadFreedom free;
  std::vector<HeadView> views;
  std::vector<FixedView> fixed;
  std::vector<LensVector> lens_start;  ///< distortion stays near it; by lens
  double sigma_px = 0.3;               ///< of one coordinate, settings at rest (medians of images)
  double moving_px = 0.3;              ///< of single images in motion
  double reading_sigma = 1e-3;         ///< [rad], see AxesSolution
  double jitter_s = 0.002;
};

/// Of one coordinate of the corners of a setting [px].
inline double corner_sigma(const HeadProblem& problem, const HeadView& view) {
  return view.moving() ? problem.moving_px : problem.sigma_px;
}

/// The angles that a setting is read to have by an encoder (HeadView::error is beside that), and
/// their derivatives by it. False where no reading is near.
bool angles_of(const HeadView& view, const EncoderVector& encoder, Eigen::Vector2d& angles,
               Eigen::Matrix<double, 2, 5>* by_encoder);

/// How the camera's place depends on each part of the chain, as tangents of world_from_camera on
/// the right.
struct HeadChain {
  Rigid3 world_from_camera;
  Matrix6 by_base;
  Eigen::Matrix<double, 6, 2> by_link, by_angles;
};
HeadChain chain_of(const Rigid3& world_from_base, const std::array<double, 2>& link,
                   const Rigid3& tilt_from_camera, const Eigen::Vector2d& angles);

/// Errors of corners [px] with derivatives by the tangents of world_from_camera and world_from_body
/// and by the lens; two rows for each corner with a weight, scaled by its root.
struct SightLinearization {
  Eigen::VectorXd error;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> place, body, lens;
};
/// False where a corner does not project.
bool linearize(const SightedBody& body, const BodySight& sight, const std::vector<double>& weights,
               LensModel lens, const double* values, const Rigid3& world_from_camera,
               const Rigid3& world_from_body, bool derivatives, SightLinearization& out);

/// One sigma of a coefficient of a lens about where it started: next to nothing where corners fill
/// the image, and it keeps what they do not determine from running away.
double coefficient_sigma(int parameter);

/// Sets each view's sigma by reading_sigma, jitter and (of an unknown side) play.
void set_sigmas(HeadProblem& problem);

}  // namespace sightline::calibrate
