// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "observe/detect/detector_frames.hpp"
#include "sightline/observe/terms/detection.hpp"

namespace sightline::observe {

/// Where an object that is missing is looked for: what is new, what moves, everything, by turns as
/// long as nothing is found.
class SearchOrder {
 public:
  using Where = DetectorFrames::Where;
  /// `center` (object frame) and `radius` of the object [m].
  SearchOrder(const Eigen::Vector3d& center, double radius) : center_(center), radius_(radius) {}

  /// The next search of these frames. What waits to be found again (null: nothing) is looked for
  /// where it was: what stands still is not among what moves; nor need be what somebody points at.
  Where next(DetectorFrames& frames, const Detection* waiting, bool pointed_at) const;
  /// What has become of it.
  void note(Where where, bool found, bool waits);

 private:
  Eigen::Vector3d center_;
  double radius_;
  Where next_ = Where::kForeground;  ///< or what comes after that, if there is none to be seen
};

}  // namespace sightline::observe
