// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sightline/observe/terms/detection.hpp"

namespace sightline::observe {

/// What the newest searches have found that stands out by too little to be believed alone. Clutter
/// is taken for the object here and there; the object is where it was, or moves steadily.
class WeakDetections {
 public:
  /// `center` (object frame) and `radius` of the object [m].
  WeakDetections(const Eigen::Vector3d& center, double radius) : center_(center), radius_(radius) {}

  /// Adds what a search has found (no pose: nothing), and says whether it is believed now: two in a
  /// row whose odds are enough together, or that each stand out by score or from what is best
  /// elsewhere, or three, at places that fit steady motion. Nothing is remembered then.
  bool confirms(const Detection& found);
  /// Adds what a search has found and what does not count, so that it is looked at again: unless
  /// something else waits.
  void keep(const Detection& found);
  /// What confirms() would take for the same object as the newest.
  bool continued_by(const Detection& found) const { return !found.poses.empty() && follows(found); }
  void clear() {
    row_.clear();
    uncounted_ = 0;
  }
  /// What waits to be found again; null: nothing. Until the next confirms() or clear().
  const Detection* newest() const { return row_.empty() ? nullptr : &row_.back(); }

 private:
  bool follows(const Detection& found) const;
  bool consistent(const Detection& earlier, const Detection& now) const;
  bool steady(const Detection& first, const Detection& second, const Detection& now) const;
  Eigen::Vector3d place(const Detection& found) const;

  Eigen::Vector3d center_;
  double radius_;
  std::vector<Detection> row_;  ///< of searches in a row, the newest last
  size_t uncounted_ = 0;        ///< of them
};

}  // namespace sightline::observe
