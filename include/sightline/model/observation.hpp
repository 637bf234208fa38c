// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "sightline/base/ids.hpp"
#include "sightline/base/time.hpp"
#include "sightline/model/pose_term.hpp"

namespace sightline {

/// A pose that an observation proposes by itself, as a start for the estimator.
struct PoseHypothesis {
  Rigid3 world_from_object;
  double cost = 0;  ///< of the observation's terms at it (see LinearizedTerm)
};

/// What one camera's frame says of one object: the product of observe, the input of fuse. Never a
/// image. An observation without terms means "searched and not seen".
struct Observation {
  ObjectId object;
  CameraId camera;
  uint32_t epoch = 0;
  uint64_t sequence = 0;
  Time capture{};
  Duration capture_error{0};
  std::vector<PoseTermPtr> terms;
  /// Stand-alone poses, best first; two for a lone planar marker that could be flipped. Empty if
  /// the observation can only refine a pose that is known.
  std::vector<PoseHypothesis> hypotheses;
  /// What the surface (colors, learned texture) says of poses that the object's shape cannot tell
  /// apart: a cost (-log likelihood, up to a constant of the list) for each. Empty: nothing. Says
  /// nothing else of the pose.
  std::vector<PoseHypothesis> symmetric_hypotheses;
  /// Its hypotheses were compared with the pose in force and explain the images better: if that is
  /// another pose, it is given up and the object starts anew from them.
  bool refutes = false;
  /// What a calibration that is known to be wrong adds to the covariance of the terms: of a tangent
  /// on the left of world_from_object (world axes) [rad, m]. Null: nothing.
  std::shared_ptr<const Matrix6> calibration_covariance{};
};

}  // namespace sightline
