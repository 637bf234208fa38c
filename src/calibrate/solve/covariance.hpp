// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calibrate/solve/bundle.hpp"

namespace sightline::calibrate {

/// Where each camera's parameters are in the joint covariance.
struct CovarianceLayout {
  struct Camera {
    int lens = 0;                 ///< first row of the free lens parameters
    std::vector<int> parameters;  ///< which they are (0..12)
    int place = -1;               ///< first of six rows; -1: the place is held
  };
  std::vector<Camera> cameras;
  int bend = -1;  ///< first of two rows; -1: held
  int size = 0;
};
CovarianceLayout layout_of(const Bundle& bundle);

/// Joint covariance of all that is estimated but the target's poses, which are marginalized:
/// sigma^2 (H_cc - H_ct H_tt^-1 H_tc)^-1 with sigma^2 from the residuals. Exact, and faster than a
/// sparse QR of the whole Jacobian: the poses of the target are independent of one another.
struct RigCovariance {
  CovarianceLayout layout;
  Eigen::MatrixXd matrix;
  double sigma_px = 0;    ///< of one coordinate of one corner
  bool singular = false;  ///< something is not determined; then `matrix` is empty
};
RigCovariance rig_covariance(const Bundle& bundle);

/// Inverse of a symmetric matrix whose parameters differ by orders of magnitude. Empty if it is
/// singular to working precision.
Eigen::MatrixXd scaled_inverse(const Eigen::MatrixXd& information);

}  // namespace sightline::calibrate
