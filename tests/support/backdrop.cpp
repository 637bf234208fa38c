// SPDX-License-Identifier: Apache-2.0
#include "support/backdrop.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "support/random.hpp"
#include "support/value_noise.hpp"

namespace sightline::test {
namespace {

constexpr float kWall = 2.6f;  // [m] half the width of the room

Eigen::Vector3f mix(const Eigen::Vector3f& a, const Eigen::Vector3f& b, float t) {
  return a + t * (b - a);
}

}  // namespace

Backdrop::Backdrop(const BackdropOptions& options) : options_(options) {
  TriangleMesh all;
  Random random(options.seed);
  for (int i = 0; i < 2 * options.clutter; ++i) {
    const bool low = i >= options.clutter;  // below the object's room
    const double angle = random.uniform(0, 2 * std::numbers::pi);
    const double away = low ? random.uniform(0.05, static_cast<double>(options.keep_free))
                            : random.uniform(static_cast<double>(options.keep_free) + 0.2, 2.3);
    const double side = low ? 0.16 : 0.4, height = low ? 0.12 : 0.9;
    const Eigen::Vector3f size =
        Eigen::Vector3d(random.uniform(0.03, side), random.uniform(0.03, side),
                        random.uniform(0.01, height))
            .cast<float>();
    const Eigen::AngleAxisf turn(static_cast<float>(random.uniform(0, 3)),
                                 Eigen::Vector3f::UnitZ());
    const Eigen::Vector3f middle(static_cast<float>(away * std::cos(angle)),
                                 static_cast<float>(away * std::sin(angle)),
                                 options.floor + 0.5f * size.z());
    const TriangleMesh box = make_box(size);
    const auto base = static_cast<uint32_t>(all.vertices.size());
    for (const auto& v : box.vertices) all.vertices.emplace_back(turn * v + middle);
    for (const auto& f : box.faces) all.faces.push_back({f[0] + base, f[1] + base, f[2] + base});
  }
  if (all.faces.empty()) return;
  clutter_ = std::make_unique<RayMesh>(finish_mesh(std::move(all), "clutter").value());
}

Eigen::Vector3f Backdrop::palette(float choice, uint32_t seed) const {
  const auto at = [&](int channel) {
    return lattice_value(static_cast<int>(choice * 997), channel, 0, seed + options_.seed);
  };
  const float bright = 0.04f + 0.5f * at(0) * at(0);
  const Eigen::Vector3f own =
      bright * (Eigen::Vector3f::Constant(0.6f) + 0.8f * Eigen::Vector3f(at(1), at(2), at(3)));
  const Eigen::Vector3f alike = (0.55f + 0.9f * at(4)) * options_.like;
  return mix(own, alike, options_.similarity);
}

Eigen::Vector3f Backdrop::floor_color(const Eigen::Vector3f& p) const {
  const int column = static_cast<int>(std::floor(p.x() / 0.31f));
  const int row = static_cast<int>(std::floor(p.y() / 0.23f));
  const float plank = lattice_value(column, row, 0, options_.seed + 5);
  const float grain =
      fractal_noise({p.x() * 9, p.y() * 55, plank * 20}, 4, 0.6f, options_.seed + 6);
  const float stain = fractal_noise(4 * p, 4, 0.5f, options_.seed + 7);
  return (0.45f + 0.6f * grain) * (0.6f + 0.8f * stain) *
         mix(palette(0.1f, 11), palette(plank, 12), 0.45f);
}

Eigen::Vector3f Backdrop::wall_color(const Eigen::Vector3f& p) const {
  // Images hang in cells of half a meter; their content is blotches of three scales.
  const float along = std::abs(p.x()) > std::abs(p.y()) ? p.y() : p.x();
  const int column = static_cast<int>(std::floor(along / 0.5f));
  const int row = static_cast<int>(std::floor(p.z() / 0.4f));
  const float u = along / 0.5f - static_cast<float>(column);
  const float v = p.z() / 0.4f - static_cast<float>(row);
  const float side = p.x() + p.y() > 0 ? 1.0f : 2.0f;
  const float chance = lattice_value(column, row, static_cast<int>(side), options_.seed + 20);
  const bool image = chance < 0.6f && u > 0.12f && u < 0.88f && v > 0.1f && v < 0.85f;
  const float rough = fractal_noise(30 * p, 5, 0.65f, options_.seed + 21);
  if (!image) {
    const float stain = fractal_noise(2.2f * p, 5, 0.55f, options_.seed + 22);
    return (0.5f + 0.5f * rough) * (0.5f + stain) * palette(0.5f + side * 0.1f, 23);
  }
  const float blotch = fractal_noise(14 * p, 3, 0.5f, options_.seed + 24);
  return (0.7f + 0.6f * rough) * palette(chance + std::floor(blotch * 7) * 0.13f, 25);
}

Eigen::Vector3f Backdrop::light(const Eigen::Vector3f& origin,
                                const Eigen::Vector3f& direction) const {
  float nearest = 1e30f;
  bool floor = false;
  if (direction.z() < 0) {
    nearest = (options_.floor - origin.z()) / direction.z();
    floor = true;
  }
  for (int axis = 0; axis < 2; ++axis) {
    if (direction[axis] == 0) continue;
    const float wall = direction[axis] > 0 ? kWall : -kWall;
    const float distance = (wall - origin[axis]) / direction[axis];
    if (distance < nearest) nearest = distance, floor = false;
  }
  Eigen::Vector3f p = origin + std::min(nearest, 50.0f) * direction;
  Eigen::Vector3f color;
  const auto box = clutter_ ? clutter_->cast(origin, direction, nearest) : std::nullopt;
  if (box) {
    p = box->point;
    const float which = static_cast<float>(box->face / 12) * 0.37f;
    const float rough = fractal_noise(25 * p, 4, 0.6f, options_.seed + 30);
    const float shade =
        0.45f + 0.55f * std::abs(box->normal.dot(Eigen::Vector3f(0.4f, 0.2f, 0.89f)));
    color = shade * (0.6f + 0.7f * rough) * palette(which, 31);
  } else {
    color = floor ? floor_color(p) : wall_color(p);
  }
  const float glow = 0.55f + 0.9f * fractal_noise(0.9f * p, 2, 0.5f, options_.seed + 40);
  return glow * color;
}

}  // namespace sightline::test
