// SPDX-License-Identifier: Apache-2.0
#include "observe/track/silhouettes/silhouette_comparison.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::observe {
namespace {

constexpr double kFilled = 0.9;          // of the grid's side by the bounding sphere
constexpr double kMinSeparation = 0.25;  // of the colors
constexpr double kMostOfCell = 1.5;      // log ratio of likelihoods
// Cells err together: what stands beside the object has one color over many of them.
constexpr double kIndependentCells = 1.0 / 8;

}  // namespace

SilhouetteComparison::SilhouetteComparison(const TrackerCamera& camera, const TrackedObject& object)
    : object_(object), grid_(camera, object, kFilled) {}

bool SilhouetteComparison::learn(uint32_t all) {
  const std::vector<uint32_t>& covered = grid_.covered();
  const std::vector<uint16_t>& bins = grid_.bins();
  foreground_.clear();
  background_.clear();
  for (size_t i = 0; i < bins.size(); ++i) {
    if (bins[i] == SilhouetteGrid::kUnknown) continue;
    if (covered[i] == all) foreground_.push_back(bins[i]);
    if (covered[i] == 0) background_.push_back(bins[i]);
  }
  colors_.forget();
  return colors_.learn(foreground_, background_, 1.0f) && colors_.separation() >= kMinSeparation;
}

const std::vector<double>& SilhouetteComparison::compare(const ColorReader& image,
                                                         const Rigid3& pose,
                                                         const Occluders& occluders) {
  costs_.clear();
  if (!grid_.aim(pose)) return costs_;
  const auto& turns = object_.shape_symmetry.near_rotations;
  grid_.draw(Rigid3(), 1);
  for (size_t k = 0; k < turns.size(); ++k) grid_.draw(turns[k], uint32_t{2} << k);
  const uint32_t all = static_cast<uint32_t>((uint64_t{2} << turns.size()) - 1);
  grid_.read(image, occluders);
  if (!learn(all)) return costs_;
  costs_.assign(turns.size() + 1, 0.0);
  const float* evidence = colors_.evidence();
  const std::vector<uint32_t>& covered = grid_.covered();
  const std::vector<uint16_t>& bins = grid_.bins();
  for (size_t i = 0; i < bins.size(); ++i) {
    if (bins[i] == SilhouetteGrid::kUnknown || covered[i] == 0 || covered[i] == all) continue;
    const double e = std::clamp(double{evidence[bins[i]]}, -0.99, 0.99);
    const double ratio = std::clamp(2 * std::atanh(e), -kMostOfCell, kMostOfCell);
    for (size_t k = 0; k < costs_.size(); ++k) {
      if ((covered[i] >> k & 1) != 0) costs_[k] -= kIndependentCells * ratio;
    }
  }
  return costs_;
}

}  // namespace sightline::observe
