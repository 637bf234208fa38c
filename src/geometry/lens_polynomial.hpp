// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

namespace sightline::geometry {

/// Radial profile of a lens: distorted radius of an undistorted one, r_d = r N(r^2) / D(r^2).
/// For pinhole lenses r = hypot(x/z, y/z); for fisheye r is the angle to the axis and D = 1.
struct RadialProfile {
  std::array<double, 5> numerator{1, 0, 0, 0, 0};  ///< coefficients of u = r^2, lowest first
  std::array<double, 4> denominator{1, 0, 0, 0};   ///< likewise
  double distorted(double r) const;
  double slope(double r) const;  ///< d(distorted)/dr
};

/// Smallest r in (0, limit) at which the profile stops growing or has a pole; `limit` where there
/// is none. Beyond it two radii share one pixel.
double fold_over_radius(const RadialProfile& profile, double limit);

/// r in [0, limit] with distorted(r) = target, for a profile that grows on [0, limit]; clamped to
/// the ends. Newton inside a shrinking bracket, to `tolerance` relative to the target.
double invert_profile(const RadialProfile& profile, double target, double limit, double tolerance);

}  // namespace sightline::geometry
