// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/rotation_between.hpp"

namespace sightline {

Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to);
}

}  // namespace sightline
