// SPDX-License-Identifier: Apache-2.0
#include "sightline/model/pose_term.hpp"

namespace sightline {

// With x = log(reference^-1 pose):  pose exp(d) = reference exp(x) exp(d)
//                                              ~ reference exp(x + Jr^-1(x) d).
LinearizedTerm FrozenTerm::linearize(const Rigid3& world_from_object) const {
  const Vector6 x = difference(reference_, world_from_object);
  const Matrix6 jacobian = right_jacobian_inverse(x);
  const Vector6 slope = at_reference_.gradient + at_reference_.information * x;
  LinearizedTerm term = at_reference_;
  term.cost = at_reference_.cost + at_reference_.gradient.dot(x) +
              0.5 * x.dot(at_reference_.information * x);
  term.gradient = jacobian.transpose() * slope;
  term.information = jacobian.transpose() * at_reference_.information * jacobian;
  return term;
}

}  // namespace sightline
