// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/observe/detect/detection_trace.hpp"

namespace sightline::observe {

/// Natural logarithm of the odds that the best pose of one search of two and more cameras is right,
/// by logistic regression (Cox, The regression analysis of binary sequences, 1958) on what a search
/// says of it. docs/detection.md, "Odds of one search": on which looks it was fitted
/// (bench/claims/fit_search_odds.py does it), and what it says of recordings that were left out.
double log_odds(const SearchEvidence& evidence);

}  // namespace sightline::observe
