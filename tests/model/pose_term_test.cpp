// SPDX-License-Identifier: Apache-2.0
#include "sightline/model/pose_term.hpp"

#include <gtest/gtest.h>

namespace sightline {
namespace {

LinearizedTerm some_term() {
  std::srand(4);
  const Matrix6 root = Matrix6::Random() * 5;
  LinearizedTerm term;
  term.information = root * root.transpose() + Matrix6::Identity();
  term.gradient = Vector6::Random();
  term.cost = 3.5;
  term.residuals = 12;
  term.quality = 0.75;
  return term;
}

Rigid3 some_pose() {
  Vector6 tangent;
  tangent << 0.4, -1.1, 0.7, 0.3, 2.0, -1.0;
  return Rigid3::exp(tangent);
}

TEST(FrozenTerm, IsWhatItWasAtItsReference) {
  const LinearizedTerm given = some_term();
  const FrozenTerm term(some_pose(), given);
  const LinearizedTerm back = term.linearize(some_pose());
  EXPECT_LT((back.information - given.information).norm(), 1e-9);
  EXPECT_LT((back.gradient - given.gradient).norm(), 1e-9);
  EXPECT_NEAR(back.cost, given.cost, 1e-12);
  EXPECT_EQ(back.residuals, 12);
  EXPECT_EQ(back.quality, 0.75);
  EXPECT_EQ(term.kind(), "frozen");
}

TEST(FrozenTerm, CostIsTheQuadraticInTheTangentOfTheReference) {
  const LinearizedTerm given = some_term();
  const FrozenTerm term(some_pose(), given);
  Vector6 x;
  x << 0.2, -0.1, 0.3, 0.05, -0.04, 0.1;
  const LinearizedTerm moved = term.linearize(some_pose() * Rigid3::exp(x));
  EXPECT_NEAR(moved.cost, given.cost + given.gradient.dot(x) + 0.5 * x.dot(given.information * x),
              1e-9);
}

TEST(FrozenTerm, GradientElsewhereIsTheNumericOne) {
  const FrozenTerm term(some_pose(), some_term());
  Vector6 x;
  x << 0.3, -0.2, 0.4, 0.1, -0.3, 0.2;
  const Rigid3 pose = some_pose() * Rigid3::exp(x);
  const LinearizedTerm here = term.linearize(pose);
  const double h = 1e-5;
  for (int i = 0; i < 6; ++i) {
    const Vector6 step = h * Vector6::Unit(i);
    const double slope = (term.linearize(pose * Rigid3::exp(step)).cost -
                          term.linearize(pose * Rigid3::exp(-step)).cost) /
                         (2 * h);
    EXPECT_NEAR(here.gradient(i), slope, 1e-5 * std::max(1.0, std::abs(slope)));
  }
}

TEST(FrozenTerm, OneStepFindsTheMinimumFromTheReference) {
  const LinearizedTerm given = some_term();
  const FrozenTerm term(some_pose(), given);
  const Vector6 step = -given.information.ldlt().solve(given.gradient);
  const LinearizedTerm best = term.linearize(some_pose() * Rigid3::exp(step));
  EXPECT_LT(best.gradient.norm(), 1e-8);
  EXPECT_LT(best.cost, given.cost);
}

}  // namespace
}  // namespace sightline
