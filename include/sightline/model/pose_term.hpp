// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string_view>

#include "sightline/geometry/rigid3.hpp"

namespace sightline {

/// A measurement linearized at a pose. With d the tangent of CONVENTIONS.md (right side):
///     cost(pose * exp(d))  ~  cost + gradient . d + d . information d / 2
/// The cost is half the (robust) sum of squares of residuals divided by their standard deviation,
/// so `information` is an inverse covariance and sums over terms and cameras.
struct LinearizedTerm {
  Matrix6 information = Matrix6::Zero();
  Vector6 gradient = Vector6::Zero();
  double cost = 0;
  int residuals = 0;   ///< scalar residuals that took part; 0: says nothing at this pose
  double quality = 0;  ///< 0 useless .. 1 everything agrees (share of inlier weight)
};

/// Seam between observe and fuse: one measurement of one camera and frame that can linearize itself
/// at any pose of the object. Immutable; any thread.
class PoseTerm {
 public:
  virtual ~PoseTerm() = default;
  virtual LinearizedTerm linearize(const Rigid3& world_from_object) const = 0;
  /// "fiducial", "region", "edge", "detection", "texture", "sparse_texture", "frozen".
  virtual std::string_view kind() const = 0;
};
using PoseTermPtr = std::shared_ptr<const PoseTerm>;

/// A measurement as another host sends it: the numbers of a linearization at a reference pose. At
/// other poses the quadratic is carried over by the right Jacobian of their difference.
class FrozenTerm : public PoseTerm {
 public:
  FrozenTerm(const Rigid3& reference, const LinearizedTerm& at_reference)
      : reference_(reference), at_reference_(at_reference) {}
  LinearizedTerm linearize(const Rigid3& world_from_object) const override;
  std::string_view kind() const override { return "frozen"; }

 private:
  Rigid3 reference_;
  LinearizedTerm at_reference_;
};

}  // namespace sightline
