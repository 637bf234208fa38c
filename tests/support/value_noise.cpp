// SPDX-License-Identifier: Apache-2.0
#include "support/value_noise.hpp"

#include <cmath>

namespace sightline::test {
namespace {

float smooth(float t) { return t * t * (3 - 2 * t); }
float mix(float a, float b, float t) { return a + (b - a) * t; }

}  // namespace

float lattice_value(int x, int y, int z, uint32_t seed) {
  uint32_t h = seed * 0x9E3779B1u;
  for (const int each : {x, y, z}) {
    h ^= static_cast<uint32_t>(each) * 0x85EBCA6Bu;
    h = (h ^ (h >> 15)) * 0x2C1B3C6Du;
    h = (h ^ (h >> 12)) * 0x297A2D39u;
  }
  h ^= h >> 15;
  return static_cast<float>(h >> 8) * 0x1.0p-24f;
}

float value_noise(const Eigen::Vector3f& p, uint32_t seed) {
  const Eigen::Array3f low = p.array().floor();
  const Eigen::Array3f t = p.array() - low;
  const Eigen::Array3i i = low.cast<int>();
  const float u = smooth(t.x()), v = smooth(t.y()), w = smooth(t.z());
  const auto at = [&](int dx, int dy, int dz) {
    return lattice_value(i.x() + dx, i.y() + dy, i.z() + dz, seed);
  };
  const auto plane = [&](int dz) {
    return mix(mix(at(0, 0, dz), at(1, 0, dz), u), mix(at(0, 1, dz), at(1, 1, dz), u), v);
  };
  return mix(plane(0), plane(1), w);
}

float fractal_noise(const Eigen::Vector3f& p, int octaves, float persistence, uint32_t seed) {
  float sum = 0, total = 0, strength = 1, scale = 1;
  for (int i = 0; i < octaves; ++i) {
    sum += strength * value_noise(p * scale, seed + static_cast<uint32_t>(i));
    total += strength;
    strength *= persistence;
    scale *= 2;
  }
  return sum / total;
}

}  // namespace sightline::test
