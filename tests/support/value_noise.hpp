// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace sightline::test {

/// A number in 0..1 that depends on three whole numbers and a seed, and on nothing else.
float lattice_value(int x, int y, int z, uint32_t seed);

/// Smooth noise in 0..1, one bump per unit (Perlin, "An image synthesizer", 1985, with values in
/// place of gradients).
float value_noise(const Eigen::Vector3f& p, uint32_t seed);

/// Noise of several scales in 0..1: each octave twice as fine and `persistence` as strong.
float fractal_noise(const Eigen::Vector3f& p, int octaves, float persistence, uint32_t seed);

}  // namespace sightline::test
