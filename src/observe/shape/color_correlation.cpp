// SPDX-License-Identifier: Apache-2.0
#include "observe/shape/color_correlation.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

namespace sightline::observe {
namespace {

constexpr size_t kMinSeen = 40;      // spots of one camera that can be compared
constexpr float kMinFacing = 0.3f;   // cosine between normal and line of sight
constexpr double kIndependent = 24;  // of the spots
constexpr double kNoColor = 0.5;     // [levels^2] variance of a channel that is not there
constexpr double kMaxAlike = 0.95;

// Mean of 3 x 3 pixels; empty at the border and outside.
std::optional<Eigen::Vector3f> color_at(const std::array<PlaneView, 3>& image,
                                        const Eigen::Vector2d& at) {
  const int x = static_cast<int>(std::floor(at.x() + 0.5));
  const int y = static_cast<int>(std::floor(at.y() + 0.5));
  if (x < 1 || y < 1 || x >= image[0].width - 1 || y >= image[0].height - 1) {
    return std::nullopt;
  }
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (int v = y - 1; v <= y + 1; ++v) {
    for (int u = x - 1; u <= x + 1; ++u) {
      for (size_t plane = 0; plane < 3; ++plane) {
        sum[static_cast<Eigen::Index>(plane)] += static_cast<float>(image[plane].row(v)[u]);
      }
    }
  }
  return sum / 9;
}

// Correlation of all channels together, each about its own mean. A channel that the image does not
// have (a gray camera) says nothing.
double correlation(const std::vector<Eigen::Vector3f>& a, const std::vector<Eigen::Vector3f>& b) {
  Eigen::Vector3d mean_a = Eigen::Vector3d::Zero(), mean_b = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < a.size(); ++i) {
    mean_a += a[i].cast<double>() / static_cast<double>(a.size());
    mean_b += b[i].cast<double>() / static_cast<double>(a.size());
  }
  Eigen::Vector3d both = Eigen::Vector3d::Zero(), only_a = both, only_b = both;
  for (size_t i = 0; i < a.size(); ++i) {
    const Eigen::Vector3d u = a[i].cast<double>() - mean_a, v = b[i].cast<double>() - mean_b;
    both += u.cwiseProduct(v);
    only_a += u.cwiseAbs2();
    only_b += v.cwiseAbs2();
  }
  const Eigen::Vector3d has =
      (only_b.array() > kNoColor * static_cast<double>(a.size())).cast<double>();
  const double scale = std::sqrt(only_a.dot(has) * only_b.dot(has));
  return scale > 1e-6 ? both.dot(has) / scale : 0;
}

}  // namespace

double color_correlation(std::span<const SurfaceSample> samples, const CameraModel& camera,
                         const Rigid3& camera_from_object,
                         const std::array<PlaneView, 3>& half_size) {
  const Eigen::Vector3f eye = camera_from_object.inverse().translation.cast<float>();
  std::vector<Eigen::Vector3f> painted, shown;
  for (const SurfaceSample& spot : samples) {
    const Eigen::Vector3f sight = eye - spot.point;
    if (sight.dot(spot.normal) < kMinFacing * sight.norm()) continue;
    const auto pixel = camera.project(camera_from_object * spot.point.cast<double>());
    if (!pixel) continue;
    const Eigen::Vector2d half = (*pixel + Eigen::Vector2d::Constant(0.5)) / 2;
    const auto color = color_at(half_size, half - Eigen::Vector2d::Constant(0.5));
    if (!color) continue;
    painted.push_back(spot.color);
    shown.push_back(*color);
  }
  return painted.size() >= kMinSeen ? correlation(painted, shown) : 0;
}

double correlation_cost(double correlation) {
  const double r = std::clamp(correlation, 0.0, kMaxAlike);
  return 0.5 * kIndependent * std::log1p(-r * r);
}

}  // namespace sightline::observe
