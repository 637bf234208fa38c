// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/judge/search_odds.hpp"

#include <algorithm>

namespace sightline::observe {
namespace {

// Printed by bench/claims/fit_search_odds.py. Above the bends another unit is worth so much more.
constexpr double kScoreBend = 0.6, kRivalBend = 0.75, kSecondBend = 0.65;
constexpr double kMostRival = 1.3;
constexpr double kConstant = -10.41, kEdges = 18.78, kColors = 1.88;
constexpr double kScore = 1.75, kScoreAbove = 6.34;
constexpr double kRival = -1.84, kRivalAbove = -11.06;
constexpr double kSecond = -2.98, kSecondAbove = -12.48;

double above(double value, double bend) { return std::max(0.0, value - bend); }

}  // namespace

double log_odds(const SearchEvidence& evidence) {
  const double rival = std::min(evidence.rival_share, kMostRival);
  return kConstant + kEdges * evidence.edge_share + kColors * std::max(0.0, evidence.colors) +
         kScore * evidence.score + kScoreAbove * above(evidence.score, kScoreBend) +
         kRival * rival + kRivalAbove * above(rival, kRivalBend) + kSecond * evidence.second_share +
         kSecondAbove * above(evidence.second_share, kSecondBend);
}

}  // namespace sightline::observe
