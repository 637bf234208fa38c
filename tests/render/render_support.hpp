// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <cstring>
#include <memory>
#include <numbers>
#include <random>

#include "sightline/render/mesh/render_mesh.hpp"
#include "sightline/render/raster/raster.hpp"
#include "sightline/render/raster/ray_table.hpp"

namespace sightline::test {

inline CameraModel::Parameters lens(int width, int height, double focal,
                                    std::initializer_list<double> distortion,
                                    LensModel model = LensModel::kBrownConrady) {
  CameraModel::Parameters p;
  p.lens = model;
  p.width = width;
  p.height = height;
  p.fx = focal;
  p.fy = focal * 1.002;
  p.cx = 0.5 * width + 3.3;
  p.cy = 0.5 * height - 5.7;
  std::copy(distortion.begin(), distortion.end(), p.distortion.begin());
  return p;
}

/// Strong barrel (A), long and mild (B), and wide with a fold-over just outside the image (C).
inline CameraModel::Parameters lens_a() { return lens(1280, 720, 900, {-0.35, 0.12, 3e-4, -2e-4}); }
inline CameraModel::Parameters lens_b() {
  return lens(1920, 1080, 1400, {-0.10, 0.05, -5e-4, 2e-4});
}
inline CameraModel::Parameters lens_c() {
  return lens(1280, 720, 620, {-0.30, 0.10, 2e-4, 5e-4, -0.012});
}
inline CameraModel::Parameters lens_fisheye() {
  return lens(800, 600, 260, {0.02, -0.006, 0.001, -0.0002}, LensModel::kFisheye);
}
inline CameraModel::Parameters lens_rational() {
  return lens(640, 480, 550, {0.4, -0.2, 5e-4, 2e-4, 0.01, 0.55, -0.1, 0.02}, LensModel::kRational);
}
/// Folds over inside the image: the corners have no rays.
inline CameraModel::Parameters lens_folding() {
  return lens(640, 480, 420, {-0.6, 0, 2e-4, -3e-4});
}

inline CameraModel camera(const CameraModel::Parameters& p) {
  return CameraModel::create(p, "test").value();
}

/// Poses and numbers that are the same on every machine (unlike the standard distributions).
class Dice {
 public:
  explicit Dice(uint32_t seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_()) / 4294967295.0);
  }
  Eigen::Quaterniond rotation() {
    const double u = uniform(0, 1), a = uniform(0, 2 * std::numbers::pi),
                 b = uniform(0, 2 * std::numbers::pi);
    return {std::sqrt(1 - u) * std::sin(a), std::sqrt(1 - u) * std::cos(a),
            std::sqrt(u) * std::sin(b), std::sqrt(u) * std::cos(b)};
  }

 private:
  std::mt19937 engine_;
};

/// A pose that puts the object's origin over `pixel` at the given depth; over the principal point
/// if the pixel has no ray.
inline Rigid3 pose_at(const CameraModel& model, const Eigen::Vector2d& pixel, double depth,
                      const Eigen::Quaterniond& rotation) {
  const Eigen::Vector3d ray = model.unproject(pixel).value_or(Eigen::Vector3d::UnitZ());
  return {rotation, ray / ray.z() * depth};
}

inline TileRect whole_frame(const RayTable& rays) {
  return {0, 0, rays.even_width(), rays.even_height()};
}

inline bool same_pixels(const RasterTile& a, const RasterTile& b) {
  if (!(a.rect() == b.rect())) return false;
  for (int y = 0; y < a.height(); ++y) {
    const auto width = static_cast<size_t>(a.width());
    if (std::memcmp(a.inverse_depth(y), b.inverse_depth(y), width * sizeof(float)) != 0 ||
        std::memcmp(a.shade(y), b.shade(y), width) != 0)
      return false;
  }
  return true;
}

}  // namespace sightline::test
