// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/image/planes.hpp"
#include "sightline/model/calibration_target.hpp"
#include "sightline/model/frame.hpp"

namespace sightline {

struct TargetDetectorOptions {
  /// Half side of the window in which corners are refined [px]; 0: from the projected squares, so
  /// that it ends before other squares and markers begin.
  int window = 0;
  double gamma = 2.2;  ///< of tag corners, see FiducialOptions
};

/// A corner of a target in an image.
struct DetectedCorner {
  int id = 0;  ///< CalibrationTarget::corner()
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

/// Finds a calibration target in single images of a camera of which nothing is known. Passive; one
/// thread at a time.
class TargetDetector {
 public:
  /// Refused: a dictionary or family that is not known, more markers than it has.
  static Result<std::unique_ptr<TargetDetector>> create(const CalibrationTarget& target,
                                                        const TargetDetectorOptions& options = {});
  virtual ~TargetDetector() = default;

  /// Corners in order of their ids; empty where the target is not seen.
  virtual std::vector<DetectedCorner> detect(const Frame& frame) = 0;

  /// Layout of a ChArUco print as the images so far say it (kAny: not known yet, or no difference).
  virtual CharucoLayout layout() const { return CharucoLayout::kAny; }
};

/// How wide the edges at the corners are, from dark to bright: their contrast over the steepest
/// slope, median over the corners [px]. Two where it is sharp; 2.5 sigma of a blur. 0: unknown.
double target_edge_width(const PlaneView& gray, const std::vector<DetectedCorner>& corners);

/// Why a target is not found in an image, in words ("the image shows markers of 4X4_50, ids 0 to
/// 16"; "mirrored"; "a chessboard of 10x7 squares"): looks for other dictionaries and families, for
/// the mirrored image, and for chessboards of other sizes. Empty if nothing speaks. Slow.
std::string explain_missing_target(const CalibrationTarget& target, const Frame& frame);

}  // namespace sightline
