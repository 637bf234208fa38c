// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>

namespace sightline {

/// The smallest rotation that turns the direction of `from` into that of `to` (neither zero, any
/// length); about any axis across them where they are opposite. Any thread.
///
/// Eigen::Quaterniond::FromTwoVectors, compiled once: with sanitizers, the singular value
/// decomposition it brings along takes a compiler minutes in every file that calls it.
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

}  // namespace sightline
