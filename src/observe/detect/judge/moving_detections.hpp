// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <utility>
#include <vector>

#include "sightline/observe/terms/detection.hpp"

namespace sightline::observe {

/// What the newest searches among what moves have found, whatever its colors say: too
/// little to be believed alone, and twice. Clutter stands still, and what is taken for the object
/// by chance is another pose each time; the object moves as one body. (Of what stands still the
/// same mistake comes again and again, so that repeating a search tells nothing.)
class MovingDetections {
 public:
  /// Least rotation between the orientations of two poses that look alike [rad].
  using Turn = std::function<double(const Rigid3&, const Rigid3&)>;
  /// `center` (object frame) and `radius` of the object [m].
  MovingDetections(const Eigen::Vector3d& center, double radius, Turn turn)
      : center_(center), radius_(radius), turn_(std::move(turn)) {}

  /// Adds what a search has found (no pose: nothing), and says whether it is believed now: three in
  /// a row at poses that fit steady motion, and that have moved. Nothing is remembered then.
  bool confirms(const Detection& found);
  /// Whether it fits what has been found before.
  bool continued_by(const Detection& found) const {
    return !found.poses.empty() && !row_.empty() && follows(found);
  }
  void clear() { row_.clear(); }
  /// What has been found again and waits for the last time; null: nothing, or it was found only
  /// once, as something is in most searches: everything else has its turn. Until the next
  /// confirms() or clear().
  const Detection* newest() const { return row_.size() < 2 ? nullptr : &row_.back(); }
  /// What is worth a look about its place: newest(), or what was found once without a rival.
  const Detection* promising() const;

 private:
  bool follows(const Detection& found) const;
  bool has_moved() const;
  Eigen::Vector3d place(const Detection& found) const;

  Eigen::Vector3d center_;
  double radius_;
  Turn turn_;
  std::vector<Detection> row_;  ///< of searches in a row, the newest last
};

}  // namespace sightline::observe
