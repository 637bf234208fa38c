// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "observe/scene/cell_reader.hpp"

namespace sightline::observe {

/// Colors of an object's surface as one camera has seen them, by place on the object: a grid of
/// cubes over its bounding sphere. A place that was never seen is not known.
class SurfaceColors {
 public:
  SurfaceColors(const Eigen::Vector3d& center, double radius);

  /// Index of the cube that holds a point of the object's frame.
  size_t at(const Eigen::Vector3f& point_in_object) const;
  bool known(size_t place) const { return cubes_[place].seen >= kFewest; }
  void learn(size_t place, const CellColor& color);
  /// Squared distance of a color from what is known there, in standard deviations. The light on
  /// the surface changes as the object turns, so brightness may differ by a good part.
  float distance(size_t place, const CellColor& color) const;
  /// True if some place of the surface is known to have about that color.
  bool has(const CellColor& color) const;
  /// True if enough of the surface was seen to say that it has no color but those.
  bool well_known() const { return samples_ >= kManySamples; }

 private:
  static constexpr int kSide = 24;
  static constexpr uint8_t kFewest = 6;
  struct Cube {
    float y = 0, u = 0, v = 0;
    float spread_y = 0, spread_c = 0;  ///< mean absolute deviations
    uint8_t seen = 0;
  };
  static constexpr int kLumaBins = 16, kChromaBins = 32;
  static size_t bin(int y, int u, int v) {
    return static_cast<size_t>((y * kChromaBins + u) * kChromaBins + v);
  }

  Eigen::Vector3f low_;
  float per_meter_;
  std::vector<Cube> cubes_;
  static constexpr int kManySamples = 4000;
  int samples_ = 0;
  std::vector<uint8_t> palette_;  ///< colors that known places had; counts, saturating
};

}  // namespace sightline::observe
