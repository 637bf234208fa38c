// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "calibrate/solve/lens_projection.hpp"
#include "sightline/calibrate/views.hpp"
#include "sightline/geometry/rigid3.hpp"

namespace sightline::calibrate {

/// A camera while it is being solved for.
struct BundleCamera {
  LensModel lens = LensModel::kBrownConrady;
  int height = 0;  ///< of its images [px]
  LensVector values{};
  std::array<bool, kLensSize> free{};  ///< which of them are estimated
  Rigid3 world_from_camera;
  bool place_free = true;
};

/// One view in the problem; `used` is by corner.
struct BundleView {
  const TargetView* view = nullptr;
  size_t camera = 0, set = 0;
  std::vector<char> used;
};

/// A rig, a target at one pose per set, and what was seen of it.
struct Bundle {
  const CalibrationTarget* target = nullptr;
  std::vector<BundleCamera> cameras;
  std::vector<Rigid3> world_from_target;  ///< by set
  std::vector<BundleView> views;
  /// Height of the target's middle over its edges along x and along y [m]: z += bend.x (1 - u^2) +
  /// bend.y (1 - v^2), u and v from -1 to 1 over the print (as mrcal's calobject_warp).
  Eigen::Vector2d bend = Eigen::Vector2d::Zero();
  bool bend_free = false;

  size_t corner_count() const;  ///< that are used
};

struct BundleOptions {
  double huber_px = 0;  ///< beyond it a corner's weight falls; 0: plain least squares
  int max_iterations = 100;
  int threads = 1;
};

struct BundleSummary {
  double rms_px = 0;  ///< over the used corners, of the distance in the image
  int iterations = 0;
  bool converged = false;
};

/// How much a unit of a coefficient of the rational lens costs [px]: next to nothing, but without
/// it numerator and denominator of a mild lens run away together. 0 for the other lenses.
double coefficient_cost(LensModel lens, int parameter);

/// Bundle adjustment with Ceres: trust region, exact derivatives, target poses eliminated first.
BundleSummary adjust(Bundle& bundle, const BundleOptions& options);

/// Corner in the target's frame, bent.
Eigen::Vector3d bent_corner(const CalibrationTarget& target, const Eigen::Vector2d& bend, int id);

/// Projection less measurement of one corner; empty where it does not project.
std::optional<Eigen::Vector2d> corner_error(const Bundle& bundle, const BundleView& view,
                                            size_t corner);

/// Where a view is linearized.
struct ViewState {
  LensModel lens = LensModel::kBrownConrady;
  int height = 0;                  ///< of the image [px]
  const double* values = nullptr;  ///< LensVector
  Rigid3 world_from_camera, world_from_target;
  Eigen::Vector2d bend = Eigen::Vector2d::Zero();
};
ViewState state_of(const Bundle& bundle, const BundleView& view);

/// Errors of a view with derivatives, by tangents: lens (14), world_from_camera (6),
/// world_from_target (6), bend (2); two rows for each used corner.
struct ViewLinearization {
  Eigen::VectorXd error;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> lens, place, target, bend;
};
/// False where a corner does not project. The derivatives only if asked for.
bool linearize(const CalibrationTarget& target, const BundleView& view, const ViewState& state,
               bool derivatives, ViewLinearization& out);

}  // namespace sightline::calibrate
