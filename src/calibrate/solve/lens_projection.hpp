// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>

#include "sightline/geometry/camera_model.hpp"

namespace sightline::calibrate {

/// What is estimated of a lens: fx fy cx cy, eight coefficients in the order of LensModel, by how
/// much later than its stamps the camera takes its images [s], and by how much later its last row
/// than its first [s].
inline constexpr int kLensSize = 14;
inline constexpr int kTimeOffset = 12, kReadout = 13;
using LensVector = std::array<double, kLensSize>;

/// Coefficients that a family has: 5, 8 or 4.
int coefficient_count(LensModel lens);

LensVector lens_vector(const CameraModel& model);
CameraModel::Parameters lens_parameters(LensModel lens, const LensVector& values, int width,
                                        int height);

/// The projection of CameraModel with its derivatives by the point (2x3) and by the first twelve
/// parameters. Unlike there, a point beyond the fold-over radius is projected: a solver passes
/// through such places. False where there is nothing to say (behind a pinhole, straight behind).
bool project_lens(LensModel lens, const double* parameters, const Eigen::Vector3d& point,
                  Eigen::Vector2d& pixel, Eigen::Matrix<double, 2, 3>* by_point,
                  Eigen::Matrix<double, 2, 12>* by_lens);

}  // namespace sightline::calibrate
