// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gmock/gmock.h>

#include <Eigen/Core>

#include "sightline/geometry/rigid3.hpp"

namespace sightline::test {

/// Same size, and every entry within `tolerance`: EXPECT_THAT(a, MatrixNear(b, 1e-9)).
MATCHER_P2(MatrixNear, expected, tolerance, "") {
  const Eigen::MatrixXd a = arg.template cast<double>();
  const Eigen::MatrixXd b = expected.template cast<double>();
  if (a.rows() != b.rows() || a.cols() != b.cols()) {
    *result_listener << "sizes differ";
    return false;
  }
  const double worst = (a - b).cwiseAbs().maxCoeff();
  *result_listener << "largest difference " << worst << ", got\n" << a << "\nwanted\n" << b;
  return worst <= tolerance;
}

/// Poses within `radians` and `meters` of each other.
MATCHER_P3(PoseNear, expected, radians, meters, "") {
  const double angle = rotation_angle(arg, expected);
  const double distance = translation_distance(arg, expected);
  *result_listener << "differs by " << angle << " rad and " << distance << " m";
  return angle <= radians && distance <= meters;
}

/// A Result that holds a value / an error whose message contains `text`.
MATCHER(IsOk, "") {
  if (!arg.has_value()) *result_listener << arg.error().message();
  return arg.has_value();
}
MATCHER_P(FailsWith, text, "") {
  if (arg.has_value()) {
    *result_listener << "it succeeded";
    return false;
  }
  *result_listener << "the error is: " << arg.error().message();
  return arg.error().message().find(text) != std::string::npos;
}

}  // namespace sightline::test
