// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "support/ray_mesh.hpp"

namespace sightline::test {

struct BackdropOptions {
  uint32_t seed = 1;
  int clutter = 40;        ///< boxes about the floor, and as many low ones near the middle
  float floor = -0.35f;    ///< [m] height of the floor
  float keep_free = 1.0f;  ///< [m] no high boxes nearer to the z axis
  /// How much its colors are those of `like` (0: its own, 1: all of it).
  float similarity = 0;
  Eigen::Vector3f like = Eigen::Vector3f::Constant(0.3f);  ///< linear RGB
};

/// A made-up room: a floor with a pattern, stained walls with images on them, clutter, uneven
/// light. The same from every camera, as a real room is. Light is linear RGB, 1 = white.
class Backdrop {
 public:
  explicit Backdrop(const BackdropOptions& options);
  /// What a ray from `origin` shows; the direction need not be unit.
  Eigen::Vector3f light(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) const;

 private:
  Eigen::Vector3f palette(float choice, uint32_t seed) const;
  Eigen::Vector3f floor_color(const Eigen::Vector3f& p) const;
  Eigen::Vector3f wall_color(const Eigen::Vector3f& p) const;

  BackdropOptions options_;
  std::unique_ptr<RayMesh> clutter_;
};

}  // namespace sightline::test
