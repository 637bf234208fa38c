// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "sightline/model/pose_term.hpp"

namespace sightline::observe {

/// Several poses that an image shows equally well, each with a quadratic about it: at any pose,
/// the one that costs least there.
class DetectionTerm : public PoseTerm {
 public:
  explicit DetectionTerm(std::vector<FrozenTerm> poses) : poses_(std::move(poses)) {}

  LinearizedTerm linearize(const Rigid3& world_from_object) const override {
    LinearizedTerm best = poses_.front().linearize(world_from_object);
    for (size_t i = 1; i < poses_.size(); ++i) {
      const LinearizedTerm other = poses_[i].linearize(world_from_object);
      if (other.cost < best.cost) best = other;
    }
    return best;
  }
  std::string_view kind() const override { return "detection"; }
  /// The same less pose `k`; at least one has to stay.
  PoseTermPtr without(size_t k) const {
    std::vector<FrozenTerm> rest = poses_;
    rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(k));
    return std::make_shared<const DetectionTerm>(std::move(rest));
  }

 private:
  std::vector<FrozenTerm> poses_;
};

}  // namespace sightline::observe
