// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
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

/// How well an image agrees with the whole silhouette of an object at its pose: shares of the
/// silhouette's area.
struct PictureAgreement {
  float unexplained = 0;  ///< of the object's colors, touches it, and nothing known explains it
  float missing = 0;      ///< of the colors around it, well inside: largest coherent part
};

/// How an image shows the print of an object's mesh.
enum class PrintSeen : uint8_t {
  kNone,  ///< the object has none, or too little of it is in place
  kFlat,  ///< in one plane, and where it was when it was first seen: a picture of it would do
  kSolid  ///< on sides that are not in one plane, or it has moved across the image
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
  /// Looked at now and then. Empty: not now, or the image does not tell.
  std::optional<PictureAgreement> picture{};
  PrintSeen print = PrintSeen::kNone;
  /// Its hypotheses were compared with the pose in force and explain the images better: if that is
  /// another pose, it is given up and the object starts anew from them.
  bool refutes = false;
  /// What is not known of where the camera stands adds to the covariance of the terms: a
  /// calibration that is known to be wrong, the angles of a camera that turns. Of a tangent on the
  /// left of world_from_object (world axes) [rad, m]. Null: nothing.
  std::shared_ptr<const Matrix6> calibration_covariance{};
};

}  // namespace sightline
