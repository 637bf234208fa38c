// SPDX-License-Identifier: Apache-2.0
#include "observe/terms/light_table.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::observe {
namespace {

constexpr double kBlack = 16, kRange = 219;  // [levels], ITU-R BT.601

}  // namespace

LightTable::LightTable(double gamma, double white) {
  for (size_t i = 0; i < values_.size(); ++i) {
    const double level = std::max(0.0, (static_cast<double>(i) - kBlack) / kRange);
    values_[i] = static_cast<float>(white * std::pow(level, gamma));
  }
}

double LightTable::white_for_unit_slope(double gamma) {
  constexpr double kMiddle = 0.5;
  return kRange / (gamma * std::pow(kMiddle, gamma - 1));
}

}  // namespace sightline::observe
