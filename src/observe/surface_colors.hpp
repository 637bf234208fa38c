// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "cell_reader.hpp"

namespace sightline::observe {

/// Colours of an object's surface as one camera has seen them, by place on the object: a grid of
/// cubes over its bounding sphere. A place that was never seen is not known.
class SurfaceColors {
 public:
  SurfaceColors(const Eigen::Vector3d& center, double radius);

  /// Index of the cube that holds a point of the object's frame.
  size_t at(const Eigen::Vector3f& point_in_object) const;
  bool known(size_t place) const { return cubes_[place].seen >= kFewest; }
  void learn(size_t place, const CellColor& color);
  /// Squared distance of a colour from what is known there, in standard deviations. The light on
  /// the surface changes as the object turns, so brightness may differ by a good part.
  float distance(size_t place, const CellColor& color) const;
  /// True if some place of the surface is known to look about like that.
  bool has(const CellColor& color) const;
  /// True if enough of the surface was seen to say that it has no colour but those.
  bool well_known() const { return looks_ >= kManyLooks; }

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
  static constexpr int kManyLooks = 4000;
  int looks_ = 0;
  std::vector<uint8_t> palette_;  ///< colours that known places had; counts, saturating
};

}  // namespace sightline::observe
