// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "fuse/bank/outcome.hpp"
#include "sightline/fuse/estimator.hpp"

namespace sightline::fuse {

/// Best first, the ones not yet proven after the one in force; of two outcomes at one pose, or at
/// poses that the shape cannot tell apart, the better one stays.
void merge_and_sort(const SymmetricHypotheses& symmetric, std::vector<Outcome>& outcomes);

/// The cameras of this set contradict the hypothesis in force (`outcomes` are sorted), and no other
/// camera supports it.
bool needs_challenger(Time time, const EstimatorOptions& options, const BankState& state,
                      std::span<const Outcome> outcomes);

/// The sorted outcomes that remain possible become the hypotheses of `state`. A challenger that was
/// confirmed often enough and explains the measurements better takes over: state.reset.
void select_hypotheses(const EstimatorOptions& options, std::vector<Outcome>& outcomes,
                       BankState& state);

}  // namespace sightline::fuse
