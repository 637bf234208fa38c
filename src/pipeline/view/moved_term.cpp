// SPDX-License-Identifier: Apache-2.0
#include "pipeline/view/moved_term.hpp"

#include <memory>
#include <utility>

namespace sightline::pipeline {
namespace {

class MovedTerm final : public PoseTerm {
 public:
  MovedTerm(PoseTermPtr term, const Rigid3& left, const Rigid3& right)
      : term_(std::move(term)), left_(left), right_(right), tangent_(right.inverse().adjoint()) {}

  LinearizedTerm linearize(const Rigid3& world_from_object) const override {
    LinearizedTerm out = term_->linearize(left_ * world_from_object * right_);
    out.information = tangent_.transpose() * out.information * tangent_;
    out.gradient = tangent_.transpose() * out.gradient;
    return out;
  }
  std::string_view kind() const override { return term_->kind(); }

 private:
  const PoseTermPtr term_;
  const Rigid3 left_, right_;
  const Matrix6 tangent_;
};

}  // namespace

void say_of_pose(const Rigid3& left, const Rigid3& right, Observation& observation) {
  for (PoseTermPtr& term : observation.terms) {
    term = std::make_shared<const MovedTerm>(std::move(term), left, right);
  }
  const Rigid3 from_left = left.inverse(), from_right = right.inverse();
  for (auto* hypotheses : {&observation.hypotheses, &observation.symmetric_hypotheses}) {
    for (PoseHypothesis& hypothesis : *hypotheses) {
      hypothesis.world_from_object = from_left * hypothesis.world_from_object * from_right;
    }
  }
}

}  // namespace sightline::pipeline
